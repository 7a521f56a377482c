// Page served by `isoform view --serve`: it polls its server, reloads when the page has changed,
// and shows the error if no page could be made.

import { h } from "./dom";

/** State of the server: number of changes, identifier of the page, and the error that prevents a
 *  newer one. */
interface News {
  news: number;
  page: number;
  failure: string | null;
}

/** Milliseconds before the next request if the server did not answer. */
const AGAIN = 1000;

const own = Number(document.querySelector<HTMLMetaElement>("[name=isoform-version]")?.content);
const told = h("pre", {});
const banner = h(
  "div",
  { class: "isoform-served", role: "status", tabindex: "0", hidden: true },
  told,
);
document.body.append(banner);

function say(text: string | null): void {
  banner.hidden = text === null;
  if (text !== null && told.textContent !== text) told.textContent = text;
}

/** Reloads the page; its view is kept in its address. */
async function reload(): Promise<void> {
  const viewer = (window as { isoform?: { ready: Promise<void>; state(): Promise<string> } })
    .isoform;
  // A page that could not show its shapes has no state.
  const state = await viewer?.ready.then(() => viewer.state()).catch(() => null);
  if (state) history.replaceState(null, "", `#${state}`);
  location.reload();
}

/** Resolves when the page is visible. Hidden pages do not poll, as a browser has few connections
 *  per server. */
const shown = () =>
  new Promise<void>((resolve) => {
    if (!document.hidden) return resolve();
    document.addEventListener("visibilitychange", () => resolve(), { once: true });
  });

async function news(after: number): Promise<News> {
  const answer = await fetch(`news?after=${after}`, { cache: "no-store" });
  if (!answer.ok) throw new Error(String(answer.status));
  return answer.json();
}

async function follow(): Promise<void> {
  for (let after = -1; ;) {
    await shown();
    try {
      const latest = await news(after);
      if (latest.page !== own) return await reload();
      after = latest.news;
      say(latest.failure && `Shown as it was before:\n${latest.failure}`);
    } catch {
      after = -1;
      say("isoform view --serve has ended: this page no longer follows its files.");
      await new Promise((f) => setTimeout(f, AGAIN));
    }
  }
}
void follow();
