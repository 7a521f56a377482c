//! Values of the parameters of a model, from the command line.

use crate::arguments;
use crate::context::Context;
use crate::failure::Failure;
use isoform::field::SolidError;
use isoform::field::hyperfun::{Model, ParamInfo};
use isoform::parameter_values;

/// Options that set parameter values, common to all verbs that take a model.
#[derive(clap::Args, Clone, Debug, Default)]
pub(crate) struct Given {
    /// The values of the parameters a, in their order or as NAME=NUMBER; missing ones are as
    /// annotated
    #[arg(long, value_name = "NUMBERS", allow_hyphen_values = true, value_parser = parameters)]
    params: Option<Parameters>,
    /// The value of one parameter, of a template or of a fitted program (repeatable)
    #[arg(
        long = "set",
        value_name = "NAME=NUMBER",
        allow_hyphen_values = true,
        value_parser = setting
    )]
    settings: Vec<(String, f64)>,
}

impl Given {
    /// True if no value is given.
    pub(crate) fn is_empty(&self) -> bool {
        self.params.is_none() && self.settings.is_empty()
    }

    /// Returns the names of the parameters that are given, of a model with these parameters.
    pub(crate) fn names<'a>(&'a self, all: &'a [String]) -> impl Iterator<Item = &'a str> {
        let params = self.params.iter();
        let first = params.clone().flat_map(|p| all.iter().take(p.first.len()));
        let named = params.flat_map(|p| &p.named).chain(&self.settings);
        first.chain(named.map(|(name, _)| name)).map(String::as_str)
    }

    /// Returns the values of `--params` alone.
    pub(crate) fn from_params(params: Option<&Parameters>) -> Self {
        Self {
            params: params.cloned(),
            settings: Vec::new(),
        }
    }
}

/// Values of the parameters a: the first ones in their order, others by name.
#[derive(Clone, Debug, Default)]
pub(crate) struct Parameters {
    first: Vec<f64>,
    named: Vec<(String, f64)>,
}

/// Reads values of parameters: numbers with commas, then NAME=NUMBER.
pub(crate) fn parameters(text: &str) -> Result<Parameters, String> {
    let words: Vec<&str> = text.split(',').collect();
    let numbers = words.iter().take_while(|word| !word.contains('=')).count();
    let (first, named) = words.split_at(numbers);
    let first = match first {
        [] => Vec::new(),
        _ => arguments::numbers(&first.join(","))?,
    };
    let named = named
        .iter()
        .map(|word| setting(word))
        .collect::<Result<_, String>>()?;
    Ok(Parameters { first, named })
}

/// Reads NAME=NUMBER.
pub(crate) fn setting(word: &str) -> Result<(String, f64), String> {
    let (name, value) = word
        .split_once('=')
        .ok_or_else(|| format!("`{word}`: NAME=NUMBER is expected"))?;
    match arguments::numbers(value)?[..] {
        [value] => Ok((name.trim().to_owned(), value)),
        _ => Err(format!("`{word}`: one number is expected")),
    }
}

/// Part of a tied value by which the one given for it may differ unsaid: tables show some digits.
const DIGITS: f64 = 1e-3;

/// The values of all parameters: those given, then as the library says.
pub(crate) fn values(model: &Model, given: &Given, context: &Context) -> Result<Vec<f64>, Failure> {
    let given = in_order(model, given)?;
    let values = parameter_values(model, &given).map_err(|error| match error {
        SolidError::Missing { ref names } => {
            let missing = |info: &&ParamInfo| names.contains(&info.label());
            let named = model.params().iter().filter(missing);
            let named: Vec<String> = named.map(|info| format!("{}=1", info.name)).collect();
            Failure::usage(format!("`{}`: {error}", model.name())).hint(format!(
                "--params {} with the right numbers, or typical= in the program",
                named.join(",")
            ))
        }
        _ => Failure::usage(format!(
            "{} parameters for `{}`, which has {}",
            given.len(),
            model.name(),
            model.n_params()
        )),
    })?;
    for (info, (given, value)) in model.params().iter().zip(given.iter().zip(&values)) {
        let Some(given) = given.filter(|_| info.tie.is_some()) else {
            continue;
        };
        if (given - value).abs() > DIGITS * value.abs() {
            context.warn(format_args!(
                "{} is tied: it is {value} for these values, and the {given} given does not count",
                info.label()
            ));
        }
    }
    Ok(values)
}

/// The values given, by parameter.
fn in_order(model: &Model, given: &Given) -> Result<Vec<Option<f64>>, Failure> {
    let Parameters { first, named } = given.params.clone().unwrap_or_default();
    let mut values: Vec<Option<f64>> = first.into_iter().map(Some).collect();
    for (name, value) in named.iter().chain(&given.settings) {
        let is_it = |info: &ParamInfo| {
            info.name.eq_ignore_ascii_case(name)
                || format!("a[{}]", info.index + 1).eq_ignore_ascii_case(name)
        };
        let Some(i) = model.params().iter().position(is_it) else {
            let names: Vec<&str> = model.params().iter().map(|p| p.name.as_str()).collect();
            return Err(Failure::usage(format!(
                "`{}`: no parameter is called {name}",
                model.name()
            ))
            .hint(format!("NAME=NUMBER with one of: {}", names.join(", "))));
        };
        if values.len() <= i {
            values.resize(i + 1, None);
        }
        if values[i].replace(*value).is_some() {
            return Err(Failure::usage(format!("{name} is given twice")));
        }
    }
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::setting;

    #[test]
    fn settings_are_finite_numbers_with_a_name() {
        assert_eq!(setting("a[3]= 2"), Ok(("a[3]".to_owned(), 2.0)));
        for wrong in ["radius", "r=inf", "r=1 2", "r="] {
            assert!(setting(wrong).is_err(), "{wrong}");
        }
    }
}
