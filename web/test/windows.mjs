// A browser for the tests of a file, and its windows.
import assert from "node:assert/strict";
import { after } from "node:test";
import { chromium } from "playwright-core";

/** Starts Chromium (CHROMIUM), which ends with the tests. */
export async function launch() {
  const browser = await chromium.launch({
    executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
    // WebGL in software. Without a graphics card the page around it is drawn faster without WebGL.
    args: [
      "--disable-gpu",
      "--use-gl=angle",
      "--use-angle=swiftshader",
      "--enable-unsafe-swiftshader",
    ],
  });
  after(() => browser.close());
  return browser;
}

/** Returns a function that opens a page, and uses it when it is ready; what the page complains of
 *  is an error at its end. Windows of pages without errors are used again: a new one takes a process,
 *  and half as long as the page in it. */
export function opener(browser, options, timeout) {
  const idle = [];
  return async (address, use, allowed = /^\b$/) => {
    const page = idle.pop() ?? (await browser.newPage(options));
    page.setDefaultTimeout(timeout);
    const errors = [];
    const onConsole = (m) => m.type() === "error" && errors.push(m.text());
    const onError = (e) => errors.push(String(e));
    page.on("console", onConsole);
    page.on("pageerror", onError);
    try {
      await page.goto(address);
      await page.evaluate("isoform.ready");
      const result = await use(page);
      assert.deepEqual(
        errors.filter((e) => !allowed.test(e)),
        [],
      );
      page.off("console", onConsole);
      page.off("pageerror", onError);
      await page.emulateMedia({ colorScheme: null });
      await page.goto("about:blank");
      idle.push(page);
      return result;
    } catch (error) {
      await page.close();
      throw error;
    }
  };
}
