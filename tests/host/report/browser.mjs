// SPDX-License-Identifier: Apache-2.0
/** A headless Chromium that draws WebGL in software, and pages in it that note whatever goes wrong. */
import {createRequire} from 'node:module';
import {join} from 'node:path';
import {pathToFileURL} from 'node:url';

const {chromium} = createRequire(join(process.env.FLEXCOMP_PACKAGES, 'package.json'))('playwright-core');

const quiet = ['--disable-quic', '--no-first-run', '--disable-background-networking', '--disable-component-update',
  '--disable-sync'];
const software = ['--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'];

export function launch({webgl = true} = {}) {
  return chromium.launch({
    executablePath: process.env.FLEXCOMP_CHROMIUM,
    // It opens files of ours alone, and a container, root or a Debian without recommended packages gives it no sandbox.
    chromiumSandbox: false,
    args: [...quiet, ...(webgl ? software : ['--disable-3d-apis'])],
  });
}

/** Opens a file; `troubles` collects console errors, exceptions and whatever was asked of a network. */
export async function open(browser, file, {width = 1280, scheme = 'light', scripts = true} = {}) {
  const context = await browser.newContext({
    viewport: {width, height: 900}, colorScheme: scheme, javaScriptEnabled: scripts, hasTouch: width < 600,
  });
  const page = await context.newPage();
  const troubles = [];
  const own = pathToFileURL(file).href;
  page.on('console', (m) => {
    // What a software renderer says of its own speed is no fault of the page.
    if (['error', 'warning'].includes(m.type()) && !/GPU stall|swiftshader/i.test(m.text())) troubles.push(`console: ${m.text()}`);
  });
  page.on('pageerror', (e) => troubles.push(`exception: ${e.message}`));
  page.on('request', (r) => { if (r.url() !== own) troubles.push(`request: ${r.url().slice(0, 100)}`); });
  await page.goto(own);
  if (scripts) await settled(page);
  return {page, troubles, close: () => context.close()};
}

/** Two frames later everything that was asked for is drawn. */
export function settled(page) {
  return page.evaluate(() => new Promise((done) => { requestAnimationFrame(() => requestAnimationFrame(done)); }));
}

/**
 * What the 3-D view shows: how many pixels are not empty, how many colours there are, how many pixels are near the page's
 * own colours, and a sum that is another one where the picture is.
 */
export function picture(page) {
  return page.evaluate(() => {
    const canvas = document.querySelector('.stage canvas');
    const gl = canvas.getContext('webgl2');
    const {drawingBufferWidth: width, drawingBufferHeight: height} = gl;
    const pixels = new Uint8Array(4 * width * height);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    // Which of three primaries rules tells the page's colours apart in every scheme.
    const near = {before: 0, after: 0, beam: 0};
    let filled = 0;
    let sum = 0;
    let edge = 0;  // coloured pixels on the rim: something leaves the picture
    const colours = new Set();
    for (let k = 0; k < pixels.length; k += 4) {
      const [r, g, b, a] = pixels.subarray(k, k + 4);
      if (a === 0) continue;
      ++filled;
      colours.add((r >> 3) << 10 | (g >> 3) << 5 | b >> 3);
      sum = (sum * 31 + r + 256 * g + 65536 * b + k) % 1000000007;
      const x = (k / 4) % width;
      const y = Math.floor(k / 4 / width);
      // Of what can be seen through the colours are as much darker.
      if (a > 40 && (x < 2 || y < 2 || x > width - 3 || y > height - 3) && Math.max(r, g, b) - Math.min(r, g, b) > 0.25 * a) ++edge;
      if (a < 200) continue;
      if (r > g + 40 && g > b + 30) ++near.before;  // orange
      if (b > r + 60 && g > r + 20 && b > g + 20) ++near.after;  // blue, not the violet of an axis
      if (g > r + 30 && g > b + 20) ++near.beam;  // green
    }
    return {width, height, filled, colours: colours.size, near, sum, edge};
  });
}

/** How many dots, bars and diamonds a plot has of which nothing lies outside its frame by more than their own size. */
export function marks(page, selector) {
  return page.evaluate((at) => [...document.querySelectorAll(`${at} svg`)].map((svg) => {
    const frame = svg.querySelector('.frame').getBBox();
    return [...svg.querySelectorAll('path:is(.before, .after, .apart)')].map((path) => {
      const box = path.getBBox();
      const inside = box.x >= frame.x - 8 && box.x + box.width <= frame.x + frame.width + 8
        && box.y >= frame.y - 8 && box.y + box.height <= frame.y + frame.height + 8;
      return inside ? path.getAttribute('d').match(/h0|H|Z/g).length : 0;
    }).reduce((a, b) => a + b, 0);
  }).reduce((a, b) => a + b, 0), selector);
}
