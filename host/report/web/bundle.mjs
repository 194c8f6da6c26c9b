// SPDX-License-Identifier: Apache-2.0
// node bundle.mjs PACKAGES OUT.cpp
//
// Bundles src/ with three (from PACKAGES/node_modules) into one script and one style sheet, and writes them as
// the C++ source that web_bundle.hpp declares.
import {createRequire} from 'node:module';
import {readFileSync, writeFileSync} from 'node:fs';
import {dirname, join, resolve} from 'node:path';
import {fileURLToPath} from 'node:url';

const [packages, output] = process.argv.slice(2).map((path) => resolve(path));
const here = dirname(fileURLToPath(import.meta.url));
const {buildSync} = createRequire(join(packages, 'package.json'))('esbuild');

// What is bundled may be passed on with its licence, and every page is a copy.
const {version} = JSON.parse(readFileSync(join(packages, 'node_modules/three/package.json'), 'utf8'));
const notice = `three ${version}\n\n${readFileSync(join(packages, 'node_modules/three/LICENSE'), 'utf8').trim()}`;
if (notice.includes('*/')) throw new Error('a licence ends the comment that it stands in');

const {outputFiles} = buildSync({
  entryPoints: [join(here, 'src/main.js')],
  absWorkingDir: here,
  nodePaths: [join(packages, 'node_modules')],
  bundle: true,
  minify: true,
  format: 'iife',
  target: ['es2020', 'chrome90', 'firefox90', 'safari15'],
  banner: {js: `/*!\n${notice}\n*/`},
  legalComments: 'none',
  charset: 'ascii',
  outdir: packages,
  write: false,
});
const text = (ending) => outputFiles.find((file) => file.path.endsWith(ending)).text.trim();

/// A raw string whose end no text contains by chance; long ones in pieces, since compilers limit one literal.
function literal(source) {
  if (source.includes(')web"')) throw new Error('the bundle contains the end of the literal that it stands in');
  const pieces = source.match(/[^]{1,8000}/g) ?? [''];
  return pieces.map((piece) => `R"web(${piece})web"`).join('\n');
}
const script = text('.js');
const style = text('.css');
// Inside the element of a page these would end it, or comment the rest out.
for (const [name, source, never] of [['script', script, /<\/script|<!--/i], ['style sheet', style, /<\/style|url\(|@import/i]]) {
  if (never.test(source)) throw new Error(`the ${name} contains ${source.match(never)[0]}`);
}
writeFileSync(output, `// Made by host/report/web/bundle.mjs.
#include "report/web_bundle.hpp"

namespace flexcomp::host {

std::string_view web_script() {
  static constexpr char text[] =
${literal(script)};
  return {text, sizeof text - 1};
}

std::string_view web_style() {
  static constexpr char text[] =
${literal(style)};
  return {text, sizeof text - 1};
}

}  // namespace flexcomp::host
`);
