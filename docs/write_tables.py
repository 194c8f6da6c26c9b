#!/usr/bin/env python3
"""Writes the figures of docs/figures.json into the tables of README.md and docs/*.md, and draws those that are drawn.

  docs/write_tables.py           writes every table and picture anew
  docs/write_tables.py --check   exit status 1 where a table or picture is not what would be written

A table stands between <!-- figures: NAME --> and <!-- end -->, each on a line of its own; TABLES has the names. Every
row of figures.json is data: numbers where something computes with them, text where only people read them.
"""
import argparse
import json
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
FIGURES = ROOT / "docs" / "figures.json"
sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT / "docs" / "pictures"))
import slope_curve  # noqa: E402
TARGETS = ["cortex-m7", "cortex-m4f", "cortex-r5f"]


def load(path=FIGURES):
    return json.loads(pathlib.Path(path).read_text(encoding="utf-8"))


def save(figures, path=FIGURES):
    """One row a line, so that a change of one figure is a change of one line."""
    text = lambda value: json.dumps(value, ensure_ascii=False)
    parts = []
    for name, table in figures.items():
        rows = ",\n".join("      " + text(row) for row in table["rows"])
        parts.append(f'  {text(name)}: {{\n    "about": {text(table["about"])},\n    "rows": [\n{rows}\n    ]\n  }}')
    pathlib.Path(path).write_text("{\n" + ",\n".join(parts) + "\n}\n", encoding="utf-8")


def grid(header, rows):
    line = lambda cells: "| " + " | ".join(str(c) for c in cells) + " |"
    return "\n".join([line(header), "|" + "---|" * len(header)] + [line(row) for row in rows])


def at_most(row):
    if "limit" in row:
        return f"{row['limit']:,}"
    return f"{row['wanted']:,} wanted" if "wanted" in row else ""


def of_targets(rows):
    return grid(["figure", "at most", *TARGETS, "what it is"],
                [[f"`{r['figure']}`", at_most(r), *(f"{r[t]:,}" for t in TARGETS), r["what"]] for r in rows])


def measured(rows):
    return grid(["what", "figure", "printed by"], [[r["what"], r["figure"], f"`{r['printed_by']}`"] for r in rows])


def first_order(rows):
    return grid(["payload", "rotations", "translations, m/m", "translations, rad/m"],
                [[f"{r['payload_kg']} kg", r["rotations"], r["translations_m_per_m"], r["translations_rad_per_m"]]
                 for r in rows])


def model_sizes(rows):
    return grid(["measured", "geometric", "all"], [[r["measured"], r["geometric"], r["all"]] for r in rows])


def in_a_controller(figures):
    """The few figures of README.md, rounded."""
    byte = {r["figure"]: r for r in figures["target_bytes"]["rows"]}
    count = {r["figure"]: r for r in figures["target_instructions"]["rows"]}
    kb = lambda value: f"{value / 1000:.1f}" if value < 9950 else f"{value / 1000:.0f}"
    pair = lambda a, b: f"{kb(a)}, {kb(b)} KB"
    return grid(
        ["", "Cortex-M7, double", "Cortex-M4F, float", "Cortex-R5F, double"],
        [["instructions of a control step with the paper's 39 terms, mean",
          *(f"{round(count['step, 39 terms, regular poses, mean'][t], -2):,}" for t in TARGETS)],
         ["flash without a bus, with CANopen and Modbus",
          *(pair(byte["flash core_store"][t], byte["flash both_buses"][t]) for t in TARGETS)],
         ["RAM without parameter sets, with them",
          *(pair(byte["ram arm+can+rtu"][t], byte["ram arm+can+rtu"][t] + byte["ram sets and staging"][t])
            for t in TARGETS)]])


PICTURES = {"slope.svg": lambda f: slope_curve.svg(f["slope_against_residual"]["rows"])}

TABLES = {
    "slope_against_residual": lambda f: grid(*slope_curve.table(f["slope_against_residual"]["rows"])),
    "target_bytes": lambda f: of_targets(f["target_bytes"]["rows"]),
    "target_instructions": lambda f: of_targets(f["target_instructions"]["rows"]),
    "in_a_controller": in_a_controller,
    "first_order": lambda f: first_order(f["first_order"]["rows"]),
    "model_sizes": lambda f: model_sizes(f["model_sizes"]["rows"]),
    **{name: (lambda f, name=name: measured(f[name]["rows"]))
       for name in ("core", "compensation", "identification", "measurement")},
}


def written(text, tables, found):
    """The text of a page with its tables written anew; the names of its tables are added to `found`."""
    def table(match):
        name = match[1]
        if name not in tables:
            raise SystemExit(f"no table is called {name!r}; there are {', '.join(tables)}")
        found.add(name)
        return f"<!-- figures: {name} -->\n{tables[name]}\n<!-- end -->"
    return re.sub(r"^<!-- figures: (\S+) -->\n.*?^<!-- end -->$", table, text, flags=re.M | re.S)


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="write nothing")
    parser.add_argument("--root", type=pathlib.Path, default=ROOT, help="of the repository")
    args = parser.parse_args(arguments)
    figures = load(args.root / "docs" / "figures.json")
    tables = {name: table(figures) for name, table in TABLES.items()}
    stale, found = 0, set()
    for name, picture in PICTURES.items():
        path = args.root / "docs" / "pictures" / name
        new = picture(figures)
        if path.exists() and path.read_text(encoding="utf-8") == new:
            continue
        if args.check:
            stale += 1
            print(f"docs/pictures/{name} is not that of docs/figures.json; docs/write_tables.py draws it")
        else:
            path.write_text(new, encoding="utf-8")
            print(f"docs/pictures/{name}: written")
    for page in [args.root / "README.md", *sorted((args.root / "docs").glob("**/*.md"))]:
        old = page.read_text(encoding="utf-8")
        new = written(old, tables, found)
        if new == old:
            continue
        stale += 1
        if args.check:
            print(f"{page.relative_to(args.root)}: a table is not that of docs/figures.json; docs/write_tables.py writes it")
        else:
            page.write_text(new, encoding="utf-8")
            print(f"{page.relative_to(args.root)}: written")
    for name in sorted(set(tables) - found):
        stale += 1
        print(f"the table {name!r} stands in no page: <!-- figures: {name} --> and <!-- end --> are missing")
    return 1 if stale and (args.check or set(tables) != found) else 0


if __name__ == "__main__":
    sys.exit(main())
