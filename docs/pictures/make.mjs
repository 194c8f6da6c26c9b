/** Pictures of the tutorial's pages: node make.mjs FOLDER_OF_PAGES FOLDER_OF_PICTURES; see make. */
import {statSync} from 'node:fs';
import {join} from 'node:path';

import {launch, open, settled} from '../../tests/host/report/browser.mjs';

const [pages, pictures] = process.argv.slice(2);
const largest = 150000;
const browser = await launch();

/** Opens a page, does what is needed, and takes the picture of one element. */
async function take(name, from, selector, prepare = async () => {}) {
  const {page, close} = await open(browser, join(pages, from), {width: 1000});
  await prepare(page);
  await settled(page);
  const path = join(pictures, `${name}.png`);
  const element = page.locator(selector).first();
  await element.scrollIntoViewIfNeeded();
  await element.screenshot({path});
  const {size} = statSync(path);
  console.log(`${path}: ${size} bytes`);
  if (size > largest) throw new Error(`${path} is larger than ${largest} bytes`);
  await close();
}

await take('arm', 'validate.html', '.view3d');
await take('residuals', 'identify.html', '.explore', async (page) => {
  await page.locator('.explore select').nth(1).selectOption({label: 'q3 [deg]'});
});
await take('gap', 'found.html', 'section:has(> h2:text("How the gap shrinks")) figure');
await take('joint3', 'found.html', 'section:has(> h2:text("What was found")) figure');
await browser.close();
