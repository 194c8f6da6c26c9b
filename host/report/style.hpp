// SPDX-License-Identifier: Apache-2.0
/// \file
/// The style sheet of a page: light, dark, phone and paper.
#pragma once

namespace flexcomp::host {

// Before is orange, after is blue: told apart by those who do not see red and green.
constexpr const char* page_style = R"css(
:root { color-scheme: light dark; }
:root, .light { --paper: #ffffff; --ink: #1c2430; --soft: #5a6472; --grid: #e3e7ec; --axis: #8b95a3; --before: #d9730d;
  --after: #1a66b0; --floor: #4f7d4a; --x: #c0392b; --y: #1f8a4c; --z: #3a5fcd; --box: #f5f7f9; --warn: #fff3dc;
  --warn-edge: #d9960d; --c1: #0072b2; --c2: #d55e00; --c3: #00916a; --c4: #b8578f; --c5: #2b323b; --c6: #87909c; }
@media screen and (prefers-color-scheme: dark) {
  :root { --paper: #14181e; --ink: #e4e8ee; --soft: #9aa5b3; --grid: #2a313b; --axis: #6c7786; --before: #f0a04b;
    --after: #6db3f2; --floor: #8fc487; --x: #f08070; --y: #62cf8e; --z: #8fa8ff; --box: #1c222a; --warn: #33290f;
    --warn-edge: #d9a53c; --c1: #56b4e9; --c2: #f0883e; --c3: #2fc79a; --c4: #dd8fc0; --c5: #e4e8ee; --c6: #8b97a6; }
}
* { box-sizing: border-box; }
body { margin: 0; background: var(--paper); color: var(--ink); font: 16px/1.5 system-ui, -apple-system, "Segoe UI", Roboto,
  "DejaVu Sans", sans-serif; }
main { max-width: 1080px; margin: 0 auto; padding: 1rem; overflow-wrap: anywhere; }
h1 { font-size: 1.6rem; line-height: 1.25; margin: .6rem 0 .4rem; }
h2 { font-size: 1.2rem; margin: 2rem 0 .4rem; border-top: 1px solid var(--grid); padding-top: 1rem; }
h3 { font-size: 1rem; margin: 1.4rem 0 .2rem; }
p { margin: .4rem 0; max-width: 46rem; }
.lead { font-size: 1.1rem; }
.headline { font-size: 1.7rem; font-weight: 600; font-variant-numeric: tabular-nums; max-width: none; }
.headline small { font-size: .95rem; font-weight: 400; color: var(--soft); }
.headline .before { color: var(--before); } .headline .after { color: var(--after); } .headline span { white-space: nowrap; }
.doubts { background: var(--warn); border-left: 4px solid var(--warn-edge); padding: .2rem 1rem; margin: 1rem 0; }
.doubts h2 { border: 0; margin: .4rem 0; padding: 0; }
.facts { display: grid; grid-template-columns: repeat(auto-fit, minmax(150px, 1fr)); gap: .5rem; margin: 1rem 0; }
.facts div { background: var(--box); padding: .4rem .7rem; border-radius: 4px; }
dt { color: var(--soft); font-size: .8rem; } dd { margin: 0; font-variant-numeric: tabular-nums; }
table { border-collapse: collapse; overflow-wrap: normal; font-variant-numeric: tabular-nums; margin: .6rem 0; }
th, td { padding: .15rem .8rem .15rem 0; text-align: right; white-space: nowrap; }
th:first-child { text-align: left; font-weight: 400; } thead th { color: var(--soft); font-weight: 400; font-size: .85rem;
  white-space: normal; vertical-align: bottom; }
tbody tr { border-top: 1px solid var(--grid); } tr.pale { color: var(--soft); }
.text { text-align: left; } td.text { white-space: normal; } td.long { min-width: 15rem; }
.parameters { font-size: .9rem; }
.scroll { overflow-x: auto; }
@media screen and (max-width: 480px) { th, td { padding-right: .55rem; } .summary { font-size: .92rem; } }
.plots { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(320px, 100%), 1fr)); gap: .6rem 1.2rem; }
.plots.wide { grid-template-columns: repeat(auto-fit, minmax(min(400px, 100%), 1fr)); }
figure { margin: .4rem 0; min-width: 0; max-width: 560px; } figcaption { color: var(--soft); font-size: .85rem; }
svg { display: block; width: 100%; height: auto; }
svg text { font: 11px system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; fill: var(--soft);
  paint-order: stroke; stroke: var(--paper); stroke-width: 3px; }
svg text.name { fill: var(--ink); }
/* Drawn for a phone; where the drawing is wider its text need not be larger than that beside it. */
@media screen and (min-width: 860px) { .wide svg text { font-size: 8.5px; } }
path { fill: none; stroke-width: 1; } .grid { stroke: var(--grid); } .axis { stroke: var(--axis); }
.stem { stroke: var(--axis); stroke-opacity: .45; } .floor { stroke: var(--floor); stroke-dasharray: 4 3; }
.line { stroke-width: 2; stroke-linejoin: round; }
.dots { stroke-width: 5; stroke-linecap: round; } .mid { stroke-width: 3.5; stroke-linecap: round; }
.fine { stroke-width: 2; stroke-linecap: round; stroke-opacity: .8; } .apart { stroke: var(--ink); stroke-width: 1.2; }
path.c1 { stroke: var(--c1); } path.c2 { stroke: var(--c2); } path.c3 { stroke: var(--c3); } path.c4 { stroke: var(--c4); }
path.c5 { stroke: var(--c5); } path.c6 { stroke: var(--c6); }
.line.c3 { stroke-dasharray: 7 3; } .line.c4 { stroke-dasharray: 2 3; } .line.c5 { stroke-dasharray: 9 3 2 3; }
.line.c6 { stroke-dasharray: 4 4; }
path.before { stroke: var(--before); } path.after { stroke: var(--after); }
.bars { fill-opacity: .35; } .bars.before { fill: var(--before); } .bars.after { fill: var(--after); }
.bars.x { fill: var(--x); fill-opacity: .2; stroke: none; }
path.x { stroke: var(--x); } path.y { stroke: var(--y); } path.z { stroke: var(--z); }
.key { color: var(--soft); font-size: .9rem; }
.mark { display: inline-block; width: .7em; height: .7em; border-radius: 50%; }
.mark.before { background: var(--before); } .mark.after { background: var(--after); }
.mark.x { background: var(--x); } .mark.y { background: var(--y); } .mark.z { background: var(--z); }
code { font-family: ui-monospace, "DejaVu Sans Mono", monospace; font-size: .9em; } a { color: var(--after); }
footer { color: var(--soft); font-size: .85rem; margin: 2.5rem 0 1rem; border-top: 1px solid var(--grid); padding-top: .5rem; }
@page { margin: 14mm; }
@media print {
  html { font-size: 10pt; } body { font-size: 1rem; } main { max-width: none; padding: 0; }
  .plots, .plots.wide { grid-template-columns: 1fr 1fr; }
  figure, tr, .doubts, .facts div, .summary, .headline { break-inside: avoid; } h2, h3, .headline { break-after: avoid; }
  .scroll { overflow: visible; } td.long { min-width: 0; } th, td { padding-right: .6rem; }
  td.text, th:first-child { white-space: normal; overflow-wrap: break-word; } .long { overflow-wrap: anywhere !important; }
  * { print-color-adjust: exact; -webkit-print-color-adjust: exact; }
}
)css";

}  // namespace flexcomp::host
