# SPDX-License-Identifier: Apache-2.0
"""Fails on a reference to a file, section or test that is not there. references.py ROOT

Looked at: links and `code` in Markdown, and comments in sources, scripts and YAML. A reference is a path with one of the endings
below, a Markdown anchor ("files.md#data-file"), a numbered section of a page, or a test by name ("image_test").
A path may be written from ROOT, from the file's own folder, from an include root, or be the end of a path ("wire/modbus_map.hpp").
Not looked at: build folders, samples of other tests, data, and what a command of the same page writes (-o NAME, <!-- file NAME -->).
"""
import re, sys
from pathlib import Path

ENDINGS = r"(?:hpp|cpp|h|c|md|cmake|py|sh|mjs|js|css|ld|S|svg|png)"
REFERENCE = re.compile(r"(?<![\w./<*{$~-])((?:\.\./)*[\w.-]*[\w-](?:/[\w.-]+)*\.%s)(?![\w/*-]|\.\w)" % ENDINGS)
SECTION = re.compile(r"([\w/.-]+\.md)(?:\)|`)*,? \(?[Ss]ections? (\d+)")
TEST = re.compile(r"^(?:\w+/)*(\w+_test)$")
FOLDERS = {"include", "firmware", "host", "hil", "tests", "toolchains", "docs", ".ci", ".github"}
INCLUDE_ROOTS = ("", "include", "include/flexcomp", "firmware", "firmware/include", "firmware/src", "firmware/boards/common", "host",
                 "hil", "hil/controller", "tests", "docs", "toolchains")
LEFT_OUT = {"build", ".git", "node_modules", "samples", "data", "__pycache__", "package-lock.json"}
C_LIKE = {".hpp", ".cpp", ".h", ".c", ".mjs", ".js", ".css", ".ld", ".S"}
HASH_LIKE = {".cmake", ".py", ".sh", ".yaml", ".yml", ""}
# Files of others, or of a reader's own project, that no command of the page writes.
FOREIGN = {"k_sin.c", "k_cos.c", "sinf.c", "robot.h"}


def files_below(root):
    for path in sorted(root.rglob("*")):
        if path.is_file() and not LEFT_OUT & set(path.relative_to(root).parts): yield path


def slug(heading):
    heading = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("`", "").strip().lower()
    return re.sub(r"[^\w\- ]", "", heading).replace(" ", "-")


def comments(path, text):
    """(line, text) of every comment."""
    if path.suffix in C_LIKE:
        token = re.compile(r'R"(\w*)\(.*?\)\1"|"(?:\\.|[^"\\\n])*"|(?<!\w)\'(?:\\.|[^\'\\\n])+\'|(//[^\n]*|/\*.*?\*/)', re.S)
        for found in token.finditer(text):
            if found[2]: yield text.count("\n", 0, found.start()) + 1, found[2]
        return
    for number, line in enumerate(text.split("\n"), 1):
        found = re.search(r"(?:^|\s)#(.*)", line)
        if found: yield number, found[1]
    if path.suffix == ".py":
        for found in re.finditer(r'^"""(.*?)"""', text, re.S | re.M): yield text.count("\n", 0, found.start()) + 1, found[1]


class Checker:
    def __init__(self, root):
        self.root = root
        self.paths = [p.relative_to(root).as_posix() for p in files_below(root)]
        # What is only referred to, never looked at: data, samples.
        self.known = {p.relative_to(root).as_posix() for p in root.rglob("*") if not {"build", ".git", "node_modules"} & set(p.relative_to(root).parts)}
        self.ends = {}
        for known in self.known:
            parts = known.split("/")
            for k in range(len(parts)): self.ends.setdefault("/".join(parts[k:]), known)
        self.stems = {Path(p).stem for p in self.known if re.search(r"_test\.(cpp|sh|py|mjs|c)$|\.test\.mjs$", p)}
        self.headings = {}
        for path in self.paths:
            if path.endswith(".md"):
                text = re.sub(r"^```.*?^```$", "", (root / path).read_text(encoding="utf-8"), flags=re.M | re.S)
                self.headings[path] = re.findall(r"^#+ (.*)$", text, re.M)
        self.wrong = []

    def find(self, name, here):
        """The file that a path leads to from the folder `here`, or None."""
        for base in (here,) + INCLUDE_ROOTS:
            path = Path(base, name)
            parts = []
            for part in path.parts:
                if part == ".." and parts: parts.pop()
                elif part != ".": parts.append(part)
            if "/".join(parts) in self.known: return "/".join(parts)
        return self.ends.get(name)

    def complain(self, path, line, what): self.wrong.append("%s:%d: %s" % (path, line, what))

    def reference(self, path, line, name, written=()):
        base = name.rsplit("/", 1)[-1]
        if name.startswith("build/") or base in FOREIGN or base in written: return
        if re.match(r"[A-Z]+\.|_", base): return  # stands for any name: NAME.cpp, *_board.h
        if self.find(name, str(Path(path).parent)) is None: self.complain(path, line, "no file " + name)

    def sections(self, path, line, text):
        for name, number in SECTION.findall(text):
            page = self.find(name, str(Path(path).parent))
            if page in self.headings and not any(re.match(number + r"\b", h) for h in self.headings[page]):
                self.complain(path, line, "no section %s in %s" % (number, page))

    def path(self, word):
        """Whether a path, a pattern of paths, the beginning of a file's name or of a test's name leads somewhere."""
        if "*" not in word and self.find(word.rstrip("/"), ""): return True
        return bool(list(self.root.glob(word)) or list(self.root.glob(word + ".*"))
                    or any(stem.startswith(word.split("/")[-1]) for stem in self.stems))

    def test(self, path, line, word):
        found = TEST.match(word)
        if not any(found[1] == stem or found[1].endswith("_" + stem) for stem in self.stems):
            self.complain(path, line, "no test " + word)

    def markdown(self, path, text):
        written = set(re.findall(r"-o (?:\S*/)?([\w.-]+)", text)) | set(re.findall(r"<!-- file (?:\S*/)?(\S+) -->", text))
        here = Path(path).parent
        fenced = False
        for line, content in enumerate(text.split("\n"), 1):
            if content.startswith("```"): fenced = not fenced
            if fenced: continue
            for target in re.findall(r"\]\(([^)\s]+)\)", content):
                if "://" in target or target.startswith("mailto:"): continue
                name, _, anchor = target.partition("#")
                page = self.find(str(here / name), "") if name else path
                # A link leads from the page alone, not from an include root.
                if name and not (self.root / here / name).exists(): self.complain(path, line, "a link to " + target)
                elif anchor and page in self.headings and anchor not in map(slug, self.headings[page]):
                    self.complain(path, line, "no section #%s in %s" % (anchor, page))
            self.sections(path, line, content)
            for code in re.findall(r"`([^`]+)`", content):
                for word in code.split():
                    word = word.strip(",;:()'\"")
                    if TEST.match(word):
                        self.test(path, line, word)
                    elif word.split("/")[0] in FOLDERS and "/" in word and not re.search(r"[…{<$:=]|NAME|TARGET", word):
                        if not self.path(word): self.complain(path, line, "no file " + word)
                    else:
                        for name in REFERENCE.findall(word): self.reference(path, line, name, written)

    def source(self, path, text):
        for line, comment in comments(Path(path), text):
            self.sections(path, line, comment)
            for row, content in enumerate(comment.split("\n")):
                content = re.sub(r"<[^>\s]*>|https?://\S+", "", content)
                for name in REFERENCE.findall(content): self.reference(path, line + row, name)

    def run(self):
        for path in self.paths:
            suffix = Path(path).suffix
            if suffix not in C_LIKE | HASH_LIKE | {".md"} and Path(path).name != "CMakeLists.txt": continue
            try: text = (self.root / path).read_text(encoding="utf-8")
            except UnicodeDecodeError: continue
            if suffix == ".md": self.markdown(path, text)
            else: self.source(path, text)
        return len(self.paths)


checker = Checker(Path(sys.argv[1]).resolve())
seen = checker.run()
for line in checker.wrong: print(line)
if not seen: sys.exit("references: no file below " + sys.argv[1])
if checker.wrong: sys.exit("references: %d lead nowhere" % len(checker.wrong))
print("references: %d files" % seen)
