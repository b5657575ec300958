#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Deliberate errors, one at a time, and whether the test suite notices.

  mutate.py generate   the mutated copy of the project, every mutant behind a run-time switch
  mutate.py build      it, leaving out the mutants that are not C++
  mutate.py run        every mutant against the tests that pass it; MODULE... or numbers limit it
  mutate.py table      the result by module, as Markdown

Needs the Debian packages python3-clang-14 and libclang-common-14-dev.

The mutants are drawn at random, the same for one --seed. Survivors that cannot be noticed are listed
with a reason in equivalent.txt. Everything else is in build/mutation.
"""
import argparse
import collections
import concurrent.futures
import dataclasses
import hashlib
import json
import multiprocessing
import os
import pathlib
import random
import re
import shutil
import subprocess
import sys
import time

import clang.cindex as ci
from clang.cindex import CursorKind as K
from clang.cindex import TypeKind as T

ROOT = pathlib.Path(__file__).resolve().parents[2]
WORK = ROOT / "build" / "mutation"
SOURCE = WORK / "source"  # the project when the mutants were drawn
TREE = WORK / "tree"
BUILD = WORK / "build"
MODULES = ["math", "kinematics", "robot", "control", "plant", "srms", "analysis", "identification"]
RELATIONS = {"<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "=="}
ARITHMETIC = {T.BOOL, T.INT, T.UINT, T.LONG, T.ULONG, T.LONGLONG, T.ULONGLONG, T.SHORT, T.USHORT,
              T.CHAR_S, T.SCHAR, T.UCHAR, T.DOUBLE, T.FLOAT}


@dataclasses.dataclass(frozen=True)
class Mutant:
    """One deliberate error: a source range, and what stands there instead.

    In the form, @ is the mutant's number and each {} one of the source ranges in parts.
    """
    file: str  # below SOURCE
    start: int
    end: int
    what: str
    form: str
    parts: tuple
    line: int
    line_text: str
    text: str


def span(cursor):
    return cursor.extent.start.offset, cursor.extent.end.offset


def canonical(cursor):
    return cursor.type.get_canonical()


def is_number(cursor):
    return canonical(cursor).kind in ARITHMETIC


def is_eigen(cursor):
    return "Eigen::" in canonical(cursor).spelling


class Finder:
    """All mutants of one file, from clang's syntax tree of it."""

    def __init__(self, path, text):
        self.path, self.text, self.found = path, text, []
        self.name = str(path.relative_to(SOURCE))
        self.lines = text.splitlines()

    def add(self, start, end, what, form, *parts):
        line = self.text.count("\n", 0, start) + 1
        self.found.append(Mutant(self.name, start, end, what, form, parts, line,
                                 self.lines[line - 1].strip(), self.text[start:end]))

    def source(self, a, b):
        return self.text[a:b]

    def walk(self, cursor, parent=None):
        if cursor.kind in (K.ENUM_DECL, K.STATIC_ASSERT, K.TEMPLATE_TYPE_PARAMETER,
                           K.TEMPLATE_NON_TYPE_PARAMETER, K.NAMESPACE_REF, K.TYPE_REF,
                           K.USING_DECLARATION, K.TYPE_ALIAS_DECL, K.TYPEDEF_DECL, K.CASE_STMT):
            if cursor.kind != K.CASE_STMT:
                return
            for child in list(cursor.get_children())[1:]:
                self.visit(child, cursor)
            return
        if cursor.kind in (K.VAR_DECL, K.FIELD_DECL, K.FUNCTION_DECL, K.CXX_METHOD,
                           K.CONSTRUCTOR, K.FUNCTION_TEMPLATE):
            a, b = span(cursor)
            head = re.split(r"[({=;]", self.source(a, b), maxsplit=1)[0]
            if "constexpr" in head or "name" == cursor.spelling:
                return
        if cursor.kind == K.FIELD_DECL:  # a default value; what it is then is configuration
            return
        for child in cursor.get_children():
            self.visit(child, cursor)

    def visit(self, cursor, parent):
        here = cursor.location.file
        if here is None or os.path.realpath(here.name) != str(self.path):
            return
        a, b = span(cursor)
        if 0 <= a < b <= len(self.text):
            self.mutate(cursor, parent, a, b)
        self.walk(cursor, parent)

    def mutate(self, cursor, parent, a, b):
        kind = cursor.kind
        text = self.source(a, b)
        if parent is not None and parent.kind == K.COMPOUND_STMT and "noalias" not in text:
            call = kind in (K.CALL_EXPR, K.BINARY_OPERATOR, K.COMPOUND_ASSIGNMENT_OPERATOR,
                            K.UNARY_OPERATOR, K.CXX_UNARY_EXPR)
            if call and self.text[b:b + 1] == ";" and "assert" not in text:
                self.add(a, b, "statement left out", "if (!::ves_m(@)) {}", (a, b))
        if kind == K.IF_STMT:
            self.condition(cursor)
        elif kind in (K.BINARY_OPERATOR, K.COMPOUND_ASSIGNMENT_OPERATOR):
            self.operator(cursor, a, b)
        elif kind == K.CALL_EXPR and cursor.spelling in ("operator+", "operator-", "operator+=",
                                                        "operator-="):
            self.overloaded(cursor, a, b)
        elif kind == K.UNARY_OPERATOR and text.startswith("-") and is_number(cursor):
            inner = next(cursor.get_children(), None)
            if inner is not None and inner.kind not in (K.INTEGER_LITERAL, K.FLOATING_LITERAL):
                c, d = span(inner)
                self.add(a, b, "sign dropped", "(::ves_m(@) ? ({}) : -({}))", (c, d), (c, d))
        elif kind in (K.FLOATING_LITERAL, K.INTEGER_LITERAL):
            self.literal(a, b, text)
        elif kind == K.CONDITIONAL_OPERATOR:
            parts = list(cursor.get_children())
            if len(parts) == 3:
                (a0, b0), (a1, b1), (a2, b2) = map(span, parts)
                self.add(a0, b0, "choice swapped", "(::ves_m(@) != ({}))", (a0, b0))
        elif kind == K.CALL_EXPR and cursor.spelling in ("min", "max", "sin", "cos", "abs"):
            self.function(cursor, a, b)

    def condition(self, cursor):
        parts = [c for c in cursor.get_children()]
        a, b = span(parts[0])
        if parts[0].kind == K.VAR_DECL or parts[0].kind == K.DECL_STMT:
            return
        if canonical(parts[0]).kind != T.BOOL:
            return
        self.add(a, b, "condition never true", "(!::ves_m(@) && ({}))", (a, b))

    def operator(self, cursor, a, b):
        parts = list(cursor.get_children())
        if len(parts) != 2:
            return
        (a0, b0), (a1, b1) = map(span, parts)
        between = self.source(b0, a1).strip()
        left, right = parts

        sides = (a0, b0), (a1, b1), (a0, b0), (a1, b1)

        def choice(other):
            return f"(::ves_m(@) ? ({{}}) {other} ({{}}) : ({{}}) {between} ({{}}))"
        if between in RELATIONS:
            self.add(a, b, f"{between} to {RELATIONS[between]}", choice(RELATIONS[between]), *sides)
        elif between in ("&&", "||"):
            side = random.Random(a).random() < 0.5
            other = "true" if between == "&&" else "false"
            keep = (a0, b0) if side else (a1, b1)
            what = f"{'right' if side else 'left'} side of {between} dropped"
            self.add(a, b, what, f"(::ves_m(@) ? bool({{}}) : ({{}}) {between} ({{}}))", keep,
                     *sides[2:])
        elif between in ("+", "-") and is_number(left) and is_number(right):
            other = "-" if between == "+" else "+"
            self.add(a, b, f"{between} to {other}", choice(other), *sides)
            self.add(a, b, f"term after {between} dropped",
                     f"(::ves_m(@) ? ({{}}) + 0 * ({{}}) : ({{}}) {between} ({{}}))", *sides)
        elif between in ("*", "/") and is_number(left) and is_number(right):
            other = "/" if between == "*" else "*"
            self.add(a, b, f"{between} to {other}", choice(other), *sides)
        elif between in ("+=", "-=") and is_number(left) and is_number(right):
            other = "-=" if between == "+=" else "+="
            self.add(a, b, f"{between} to {other}", choice(other), *sides)

    def overloaded(self, cursor, a, b):
        arguments = list(cursor.get_arguments())
        if len(arguments) == 1 and cursor.spelling == "operator-":
            c, d = span(arguments[0])
            if is_eigen(arguments[0]) and c > a:
                self.add(a, b, "sign dropped", "(::ves_f(@, -1.0) * -({}))", (c, d))
            return
        if len(arguments) != 2:
            return
        (a0, b0), (a1, b1) = map(span, arguments)
        symbol = cursor.spelling[len("operator"):]
        if "noalias" in self.source(a, b):
            return
        if is_eigen(arguments[1]):
            for what, factor in ((f"{symbol} reversed", "-1.0"),
                                 (f"term after {symbol} dropped", "0.0")):
                self.add(a1, b1, what, f"(::ves_f(@, {factor}) * ({{}}))", (a1, b1))
        elif symbol in ("+", "-"):
            self.add(a, b, f"term after {symbol} dropped",
                     f"(::ves_m(@) ? ({{}}) : ({{}}) {symbol} ({{}}))",
                     (a0, b0), (a0, b0), (a1, b1))

    def literal(self, a, b, text):
        before, after = self.text[a - 1:a], self.text[b:b + 1]
        if before == "<" or after == ">" or self.text[a - 2:a] == "<-":
            return
        if re.fullmatch(r"[0-9']+\.[0-9e']*|[0-9]+e-?[0-9]+|[0-9.]+e-?[0-9]+", text):
            zero = float(text.replace("'", "")) == 0.0
            other = "1.0" if zero else f"1.25 * {text}"
            self.add(a, b, f"{text} to {other}", f"(::ves_m(@) ? {other} : {text})")
        elif re.fullmatch(r"[0-9]+", text):
            self.add(a, b, f"{text} to {int(text) + 1}",
                     f"(::ves_m(@) ? {int(text) + 1} : {text})")

    def function(self, cursor, a, b):
        text = self.source(a, b)
        swap = {"min": "max", "max": "min", "sin": "cos", "cos": "sin"}
        name = cursor.spelling
        m = re.match(r"std::" + name + r"(<[^(]*>)?\(", text)
        if not m or not is_number(cursor):
            return
        inner = a + m.end(), b - 1
        if "{" in self.text[a:inner[0] + 1]:
            return
        if name == "abs":
            self.add(a, b, "abs dropped", "(::ves_m(@) ? ({}) : std::abs({}))", inner, inner)
        else:
            head = m.group(0)
            other = head.replace("::" + name, "::" + swap[name])
            self.add(a, b, f"{name} to {swap[name]}",
                     f"(::ves_m(@) ? {other}{{}}) : {head}{{}}))", inner, inner)


def sources(module):
    headers = sorted((SOURCE / "include" / "ves" / module).glob("*.hpp"))
    return sorted((SOURCE / "src" / module).glob("*.cpp")) + headers


def find(path):
    """All mutants of one source file."""
    flags = ["-xc++", "-std=c++20", f"-I{SOURCE}/include", "-I/usr/include/eigen3",
             "-isystem", "/usr/lib/llvm-14/lib/clang/14.0.6/include"]
    unit = ci.Index.create().parse(str(path), args=flags)
    fatal = [d for d in unit.diagnostics if d.severity >= 3]
    if fatal:
        sys.exit(f"{path}: {fatal[0].spelling}")
    finder = Finder(path, path.read_text())
    for child in unit.cursor.get_children():
        finder.visit(child, None)
    return list({(m.start, m.end, m.what): m for m in finder.found}.values())


def find_all():
    paths = [(module, path) for module in MODULES for path in sources(module)]
    with multiprocessing.Pool() as pool:
        found = pool.map(find, [path for _, path in paths], chunksize=1)
    out = {module: [] for module in MODULES}
    for (module, _), mutants in zip(paths, found):
        out[module] += mutants
    return out


def draw(found, count, seed):
    """So many mutants in all, by the modules' shares; never two at exactly one place.

    A mutant's lot depends on its own line alone: an edit elsewhere does not draw anew.
    """
    total = sum(len(v) for v in found.values())
    chosen = []
    for module, mutants in found.items():
        met = collections.Counter()
        lots = []
        for m in mutants:
            key = f"{seed} {m.file} {m.line_text} {m.text} {m.what}"
            met[key] += 1
            lots.append((hashlib.sha256(f"{key} {met[key]}".encode()).digest(), m))
        wanted, taken = max(20, round(count * len(mutants) / total)), set()
        for _, m in sorted(lots, key=lambda lot: lot[0]):
            if wanted and (m.file, m.start, m.end) not in taken:
                taken.add((m.file, m.start, m.end))
                chosen.append((module, m))
                wanted -= 1
    return chosen


def render(text, mutants):
    """The text with every mutant of it, inner ones inside outer ones."""
    def range_(lo, hi, skip):
        inside = [m for m in mutants if lo <= m["start"] and m["end"] <= hi and m["id"] not in skip]
        outer = [m for m in inside if not any(
            o is not m and o["start"] <= m["start"] and m["end"] <= o["end"] for o in inside)]
        result, at = [], lo
        for m in sorted(outer, key=lambda x: x["start"]):
            if m["start"] < at:
                continue  # overlaps another without being inside it
            result.append(text[at:m["start"]])
            pieces = m["form"].replace("@", str(m["id"])).split("{}")
            result.append(pieces[0])
            for (a, b), piece in zip(m["parts"], pieces[1:]):
                result += [range_(a, b, skip | {m["id"]}), piece]
            at = m["end"]
        result.append(text[at:hi])
        return "".join(result)
    return range_(0, len(text), frozenset())


def key_of(record):
    return f"{record['file']} | {record['line_text']} | {record['what']}"


def put(target, content, mode_of):
    """Writes what differs, so that nothing is built again without need."""
    if target.exists() and target.read_bytes() == content:
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_bytes(content)
    shutil.copymode(mode_of, target)


def snapshot():
    listed = subprocess.run(["git", "-C", str(ROOT), "ls-files", "-co", "--exclude-standard"],
                            capture_output=True, text=True, check=True).stdout.splitlines()
    present = {name for name in listed if (ROOT / name).is_file()}
    for old in SOURCE.rglob("*"):
        if old.is_file() and str(old.relative_to(SOURCE)) not in present:
            old.unlink()
            (TREE / old.relative_to(SOURCE)).unlink(missing_ok=True)
    for name in present:
        put(SOURCE / name, (ROOT / name).read_bytes(), ROOT / name)


def generate(args):
    WORK.mkdir(parents=True, exist_ok=True)
    snapshot()
    chosen = draw(find_all(), args.count, args.seed)
    records = [{"id": number, "module": module, **dataclasses.asdict(m)}
               for number, (module, m) in enumerate(chosen, start=1)]
    (WORK / "mutants.json").write_text(json.dumps(records, indent=1))
    (WORK / "dropped.json").write_text("[]")
    write_tree(records, set())
    print(f"{len(records)} mutants")


def write_tree(records, dropped):
    by_file = collections.defaultdict(list)
    for m in records:
        if m["id"] not in dropped:
            by_file[SOURCE / m["file"]].append(m)
    for source in SOURCE.rglob("*"):
        if source.is_file():
            content = source.read_bytes()
            if source in by_file:
                # Beside the others' includes: before them it would spoil the precompiled headers.
                text = render(source.read_text(), by_file[source])
                switch = f'#include "{TREE}/tests/mutation/mutant.hpp"\n#include '
                content = text.replace("#include ", switch, 1).encode()
            put(TREE / source.relative_to(SOURCE), content, source)


def build(_):
    flags = "-O1 -w -D_GLIBCXX_ASSERTIONS"  # with assert(): an index past the end is noticed
    configure = ["cmake", "-S", str(TREE), "-B", str(BUILD), "-G", "Ninja",
                 "-DCMAKE_BUILD_TYPE=Release", "-DCMAKE_CXX_FLAGS_RELEASE=" + flags]
    records = json.loads((WORK / "mutants.json").read_text())
    dropped = set(json.loads((WORK / "dropped.json").read_text()))
    for _ in range(8):
        subprocess.run(configure, check=True, stdout=subprocess.DEVNULL)
        made = subprocess.run(["cmake", "--build", str(BUILD), "--", "-k", "0"],
                              capture_output=True, text=True)
        if made.returncode == 0:
            print(f"built; {len(dropped)} mutants are not C++")
            return
        bad = set()
        for file, line in re.findall(r"^(\S+?):(\d+):\d+: error", made.stdout, re.M):
            lines = pathlib.Path(file).read_text().splitlines()
            for k in range(max(0, int(line) - 2), min(len(lines), int(line) + 1)):
                bad |= {int(n) for n in re.findall(r"ves_[mf]\((\d+)", lines[k])}
        if not bad - dropped:
            print(made.stdout[-4000:])
            sys.exit("the mutated tree does not build")
        dropped |= bad
        (WORK / "dropped.json").write_text(json.dumps(sorted(dropped)))
        write_tree(records, dropped)
    sys.exit("too many mutants are not C++")


def environment(**more):
    return {**os.environ, "VES_CONFIG_DIR": str(TREE / "config"), "GTEST_FAIL_FAST": "1",
            "GTEST_BRIEF": "1", **more}


FAULTS = "Faults.Table"  # the one test of ctest that is no gtest


def command(binary, names):
    if binary == FAULTS:
        return [BUILD / "apps" / "ves", "faults", "--lockstep"]
    return [BUILD / "tests" / binary, "--gtest_filter=" + ":".join(names)]


def all_tests():
    """[binary, test] of everything that ctest would run, live processes left out."""
    out = [(FAULTS, FAULTS)]
    for binary in sorted((BUILD / "tests").glob("*_test")):
        if binary.name in ("programs_test", "console_test", "doctor_test", "layering_test"):
            continue
        listing = subprocess.run([binary, "--gtest_list_tests"], capture_output=True, text=True,
                                 check=True).stdout
        suite = ""
        for line in listing.splitlines():
            name = line.split("#")[0].rstrip()
            if name and not name.startswith(" "):
                suite = name
            elif name:
                out.append((binary.name, suite + name.strip()))
    return out


def cover(test):
    binary, name = test
    file = WORK / "coverage" / f"{abs(hash(test))}"
    file.unlink(missing_ok=True)
    start = time.monotonic()
    done = subprocess.run(command(binary, [name]),
                          env=environment(VES_MUTANT_COVERAGE=str(file)), cwd=BUILD / "tests",
                          stdin=subprocess.DEVNULL, capture_output=True, text=True)
    seconds = time.monotonic() - start
    seen = sorted({int(n) for n in file.read_text().split()}) if file.exists() else []
    return {"binary": binary, "name": name, "seconds": seconds, "seen": seen,
            "status": done.returncode}


def measure_coverage():
    (WORK / "coverage").mkdir(exist_ok=True)
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        tests = list(pool.map(cover, all_tests()))
    failing = [t["name"] for t in tests if t["status"] != 0]
    if failing:
        print(f"left out, because they fail without any mutant: {failing}", flush=True)
    tests = [t for t in tests if t["status"] == 0]
    (WORK / "coverage.json").write_text(json.dumps(tests))
    print(f"{len(tests)} tests in {sum(t['seconds'] for t in tests):.0f} s")
    return tests


def attack(record, tests, before):
    """The first test that notices the mutant: the one that did so last time, then the quickest."""
    covering = sorted((t for t in tests if record["id"] in t["seen"]), key=lambda t: t["seconds"])
    if not covering:
        return {**record, "killed_by": None, "covered": 0}
    by_binary = collections.OrderedDict()
    for t in covering:
        by_binary.setdefault(t["binary"], []).append(t)
    last = [(t["binary"], [t]) for t in covering if t["name"] == before.get(key_of(record))]
    for binary, some in last + list(by_binary.items()):
        allowed = 10.0 + 6.0 * sum(t["seconds"] for t in some)
        try:
            done = subprocess.run(
                command(binary, [t["name"] for t in some]),
                env=environment(VES_MUTANT=str(record["id"])), cwd=BUILD / "tests",
                stdin=subprocess.DEVNULL, capture_output=True, text=True, errors="replace",
                timeout=allowed)
        except subprocess.TimeoutExpired:
            return {**record, "killed_by": f"{binary}: time out", "covered": len(covering)}
        if done.returncode != 0:
            failed = re.search(r"\[  FAILED  \] (\S+)", done.stdout)
            name = failed.group(1).rstrip(",") if failed else f"{binary}: status {done.returncode}"
            return {**record, "killed_by": name, "covered": len(covering)}
    return {**record, "killed_by": None, "covered": len(covering)}


def run(args):
    records = json.loads((WORK / "mutants.json").read_text())
    dropped = set(json.loads((WORK / "dropped.json").read_text()))
    results_file = WORK / "results.json"
    results = {r["id"]: r for r in json.loads(results_file.read_text())} \
        if results_file.exists() and args.which else {}
    before = {key_of(r): r["killed_by"] for r in json.loads(results_file.read_text())} \
        if results_file.exists() else {}
    wanted = set(args.which)
    chosen = [r for r in records if r["id"] not in dropped and
              (not wanted or str(r["id"]) in wanted or r["module"] in wanted or
               ("survivors" in wanted and not results.get(r["id"], {}).get("killed_by")))]
    tests = measure_coverage()
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        for n, result in enumerate(pool.map(lambda r: attack(r, tests, before), chosen), start=1):
            results[result["id"]] = result
            if not result["killed_by"]:
                print(f"{result['id']:4} {result['file']}:{result['line']}: {result['what']}: "
                      f"{result['text'][:70]!r} ({result['covered']} tests pass it)", flush=True)
            if n % 20 == 0:
                results_file.write_text(json.dumps(list(results.values()), indent=1))
    results_file.write_text(json.dumps(list(results.values()), indent=1))
    table(args)


def equivalents():
    out = {}
    for line in (pathlib.Path(__file__).parent / "equivalent.txt").read_text().splitlines():
        if line.strip() and not line.startswith("#"):
            key, _, reason = line.rpartition(" | ")
            out[key] = reason
    return out


def table(_):
    results = json.loads((WORK / "results.json").read_text())
    known = equivalents()
    rows = collections.defaultdict(lambda: [0, 0, 0, 0])
    for r in results:
        equivalent = not r["killed_by"] and key_of(r) in known
        for name in (r["module"], "all"):
            row = rows[name]
            row[0] += 1
            row[1] += bool(r["killed_by"])
            row[2] += equivalent
            row[3] += not r["killed_by"] and not equivalent
    print("| module | mutants | killed | equivalent | survived | killed of the rest |")
    print("|---|---|---|---|---|---|")
    for name in [*MODULES, "all"]:
        n, killed, equivalent, survived = rows[name]
        share = 100.0 * killed / max(1, n - equivalent)
        print(f"| {name} | {n} | {killed} | {equivalent} | {survived} | {share:.1f} % |")


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=480)
    parser.add_argument("step", choices=["generate", "build", "run", "table"])
    parser.add_argument("which", nargs="*", help="modules, numbers, or 'survivors'")
    args = parser.parse_args()
    {"generate": generate, "build": build, "run": run, "table": table}[args.step](args)


if __name__ == "__main__":
    main()
