//! Functions of a source file and their size.

use proc_macro2::{Spacing, TokenStream, TokenTree};
use quote::ToTokens;
use syn::visit::{self, Visit};

/// Size of a function with a body. Nested functions and closures count as parts of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Function {
    /// Name, qualified by the type it belongs to.
    pub(crate) name: String,
    /// Line of the name.
    pub(crate) line: usize,
    /// Number of tokens from the visibility to the closing brace, without attributes and comments.
    pub(crate) tokens: usize,
    /// Cyclomatic complexity (McCabe, IEEE Transactions on Software Engineering 2, 1976): one more
    /// than the number of `if`, `while`, `for`, arms of `match`, `&&`, `||` and `?`.
    pub(crate) cyclomatic: usize,
}

/// Returns all functions of a file except those of its tests.
///
/// # Errors
/// If the text is not valid Rust.
pub(crate) fn functions(text: &str) -> syn::Result<Vec<Function>> {
    let file = syn::parse_file(text)?;
    let mut found = FunctionCollector::default();
    found.visit_file(&file);
    Ok(found.functions)
}

#[derive(Default)]
struct FunctionCollector {
    /// Type or trait whose methods are being visited.
    owner: Option<String>,
    functions: Vec<Function>,
}

impl FunctionCollector {
    fn add(&mut self, ident: &syn::Ident, tokens: TokenStream, block: &syn::Block) {
        let name = match &self.owner {
            Some(owner) => format!("{owner}::{ident}"),
            None => ident.to_string(),
        };
        let mut branches = BranchCounter(0);
        branches.visit_block(block);
        self.functions.push(Function {
            name,
            line: ident.span().start().line,
            tokens: count(tokens),
            cyclomatic: branches.0 + 1,
        });
    }
}

/// Returns true if an item is compiled for tests only.
fn is_test(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        let text = attribute.meta.to_token_stream().to_string();
        text == "test" || text == "cfg (test)"
    })
}

impl<'ast> Visit<'ast> for FunctionCollector {
    fn visit_item_mod(&mut self, item: &'ast syn::ItemMod) {
        if !is_test(&item.attrs) {
            visit::visit_item_mod(self, item);
        }
    }

    fn visit_item_impl(&mut self, item: &'ast syn::ItemImpl) {
        if is_test(&item.attrs) {
            return;
        }
        let name = match &*item.self_ty {
            syn::Type::Path(path) => path.path.segments.last().map(|s| s.ident.to_string()),
            _ => None,
        };
        let outer = std::mem::replace(&mut self.owner, name);
        visit::visit_item_impl(self, item);
        self.owner = outer;
    }

    fn visit_item_trait(&mut self, item: &'ast syn::ItemTrait) {
        let outer = self.owner.replace(item.ident.to_string());
        visit::visit_item_trait(self, item);
        self.owner = outer;
    }

    fn visit_item_fn(&mut self, item: &'ast syn::ItemFn) {
        if is_test(&item.attrs) {
            return;
        }
        let mut bare = item.clone();
        bare.attrs.clear();
        self.add(&item.sig.ident, bare.into_token_stream(), &item.block);
        visit::visit_item_fn(self, item);
    }

    fn visit_impl_item_fn(&mut self, item: &'ast syn::ImplItemFn) {
        if is_test(&item.attrs) {
            return;
        }
        let mut bare = item.clone();
        bare.attrs.clear();
        self.add(&item.sig.ident, bare.into_token_stream(), &item.block);
        visit::visit_impl_item_fn(self, item);
    }

    fn visit_trait_item_fn(&mut self, item: &'ast syn::TraitItemFn) {
        if let Some(block) = &item.default {
            let mut bare = item.clone();
            bare.attrs.clear();
            self.add(&item.sig.ident, bare.into_token_stream(), block);
        }
        visit::visit_trait_item_fn(self, item);
    }
}

/// Counter of branches in the control flow of a function.
struct BranchCounter(usize);

impl<'ast> Visit<'ast> for BranchCounter {
    fn visit_expr(&mut self, expression: &'ast syn::Expr) {
        use syn::{BinOp, Expr};
        self.0 += match expression {
            Expr::If(_) | Expr::While(_) | Expr::ForLoop(_) | Expr::Try(_) => 1,
            Expr::Match(m) => m.arms.len(),
            Expr::Binary(b) => usize::from(matches!(b.op, BinOp::And(_) | BinOp::Or(_))),
            _ => 0,
        };
        visit::visit_expr(self, expression);
    }
}

/// Counts tokens like a lexer: an operator of two characters is one token, and so is a lifetime.
fn count(tokens: TokenStream) -> usize {
    let mut number = 0;
    let mut is_joint = false;
    for token in tokens {
        match token {
            TokenTree::Group(group) => {
                let braces = usize::from(group.delimiter() != proc_macro2::Delimiter::None) * 2;
                number += braces + count(group.stream());
                is_joint = false;
            }
            TokenTree::Punct(p) => {
                number += usize::from(!is_joint);
                is_joint = p.spacing() == Spacing::Joint;
            }
            TokenTree::Ident(_) | TokenTree::Literal(_) => {
                number += usize::from(!is_joint);
                is_joint = false;
            }
        }
    }
    number
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(text: &str) -> Function {
        let mut found = functions(text).unwrap_or_default();
        assert_eq!(found.len(), 1, "{text}");
        found.remove(0)
    }

    #[test]
    fn tokens_are_those_of_the_lexer() {
        // fn f ( a : & 'a [ u8 ] ) -> u8 { a [ 0 ] + 1 }
        let f = one("/// Doc.\n#[inline]\nfn f(a: &'a [u8]) -> u8 { a[0] + 1 }");
        assert_eq!((f.tokens, f.cyclomatic, f.line), (21, 1, 3));
        assert_eq!(one("fn f() { a::b <<= 1 }").tokens, 11);
    }

    #[test]
    fn branches_are_counted() {
        let text = "fn f(x: u8) -> Option<u8> { for i in 0..x { if x > i && x > 3 { g(i)?; } }
            match x { 0 => Some(1), _ => None } }";
        assert_eq!(one(text).cyclomatic, 7);
    }

    #[test]
    fn tests_do_not_count() {
        let text = "#[cfg(test)] mod tests { fn f() {} } #[test] fn g() {} struct A;
            impl A { fn h(&self) {} }";
        assert_eq!(one(text).name, "A::h");
    }
}
