# SPDX-License-Identifier: BSD-3-Clause
"""Draws deliberate errors from clang's syntax tree of the source, and writes them into it."""
import collections
import dataclasses
import hashlib
import multiprocessing
import os
import pathlib
import random
import re
import sys

import clang.cindex as ci
from clang.cindex import CursorKind as K
from clang.cindex import TypeKind as T

ROOT = pathlib.Path(__file__).resolve().parents[2]
SOURCE = ROOT / "build" / "mutation" / "source"  # the project when the mutants were drawn
MODULES = sorted(p.name for p in (ROOT / "src").iterdir() if p.is_dir())
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


def is_rotation(cursor):
    return "Eigen::Matrix<double, 3, 3" in canonical(cursor).spelling


def sibling(field):
    """The next field of the same type in the same struct, in a ring; none: there is no other."""
    if field is None or field.kind != K.FIELD_DECL:
        return None
    fields = [c for c in field.semantic_parent.get_children() if c.kind == K.FIELD_DECL]
    kind = field.type.get_canonical().spelling
    alike = [c.spelling for c in fields if c.type.get_canonical().spelling == kind]
    if len(alike) < 2:
        return None
    return alike[(alike.index(field.spelling) + 1) % len(alike)]


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
        if cursor.kind == K.COMPOUND_STMT:
            self.neighbours(list(cursor.get_children()))
        if cursor.kind in (K.FUNCTION_DECL, K.CXX_METHOD) and canonical(cursor).spelling.startswith("void "):
            self.early_return(cursor)
        for child in cursor.get_children():
            self.visit(child, cursor)

    def is_call(self, cursor):
        """A statement that can change places with another: a call or an assignment by itself."""
        b = span(cursor)[1]
        return cursor.kind in (K.CALL_EXPR, K.BINARY_OPERATOR) and self.text[b:b + 1] == ";"

    def neighbours(self, statements):
        for one, two in zip(statements, statements[1:]):
            if not (self.is_call(one) and self.is_call(two)):
                continue
            (a0, b0), (a1, b1) = span(one), span(two)
            if "assert" not in self.text[a0:b1] and self.share(self.text[a0:b0], self.text[a1:b1]):
                self.add(a0, b1, "two statements exchanged",
                         "if (::ves_m(@)) { {}; {}; } else { {}; {}; }",
                         (a1, b1), (a0, b0), (a0, b0), (a1, b1))

    @staticmethod
    def share(one, two):
        """One of them changes what the other names: else their order has no meaning."""
        def sides(text):  # of an assignment
            return re.match(r"([^=!<>]+?)\s*[-+*/|&]?=(?!=)(.*)", text, re.S)

        if (a := sides(one)) and (b := sides(two)):
            (to, of), (to_2, of_2) = a.groups(), b.groups()
            def named(whole, text):
                return re.search(rf"(?<![\w.]){re.escape(whole)}(?!\w)", text)

            def within(whole, part):  # or the same
                return part == whole or part.startswith((whole + ".", whole + "["))

            return named(to, of_2) or named(to_2, of) or within(to, to_2) or within(to_2, to)

        def names(text):
            return set(re.findall(r"[A-Za-z_]\w{2,}", text)) - {"std", "Zero", "move"}

        def changed(text):
            return set(re.findall(r"([A-Za-z_]\w{2,})(?:\([^()]*\)|\[[^\]]*\])?\s*[-+*/|&]?=[^=]", text)) | \
                set(re.findall(r"([A-Za-z_]\w{2,})\.\w+\(", text))
        return bool(changed(one) & names(two) or changed(two) & names(one))

    def early_return(self, function):
        body = [c for c in function.get_children() if c.kind == K.COMPOUND_STMT]
        statements = list(body[0].get_children()) if body else []
        if len(statements) > 1 and statements[-1].kind != K.DECL_STMT:
            a, b = span(statements[-1])
            if a < b:
                self.add(a, a, "early return", "if (::ves_m(@)) return; ")

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
                (a0, b0), (a1, _), _ = map(span, parts)
                if "?" in self.source(b0, a1):  # and not in a macro
                    self.add(a0, b0, "choice swapped", "(::ves_m(@) != ({}))", (a0, b0))
        elif kind == K.CALL_EXPR and cursor.spelling == "transpose" and text.endswith(".transpose()"):
            inner = a, b - len(".transpose()")
            if is_rotation(next(cursor.get_children())) or is_rotation(cursor):
                self.add(a, b, "transpose dropped",
                         "::ves::Mat3(::ves_m(@) ? ::ves::Mat3({}) : ::ves::Mat3(({}).transpose()))",
                         inner, inner)
        elif kind == K.MEMBER_REF_EXPR:
            self.member(cursor, a, b, text)
        elif kind == K.CALL_EXPR and cursor.spelling in ("min", "max", "sin", "cos", "abs"):
            self.function(cursor, a, b)

    def member(self, cursor, a, b, text):
        other = sibling(cursor.referenced)
        name = cursor.spelling
        if other is None or not text.endswith(name) or self.text[b:b + 1] == "(":
            return
        before = text[:len(text) - len(name)]
        if before.endswith("::"):
            return
        self.add(a, b, f"{name} for {other}",
                 f"(::ves_m(@) ? {before}{other} : {before}{name})")

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
        elif between == "*" and re.fullmatch(r"k[A-Z]\w*", self.source(a1, b1)) and is_number(left):
            self.add(a, b, f"factor {self.source(a1, b1)} lost",
                     "(::ves_m(@) ? 1.0 * ({}) : ({}) * ({}))", (a0, b0), (a0, b0), (a1, b1))
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


def find(module):
    """All mutants of a module's files, which are read in one go: they share what they include."""
    finders = {str(path): Finder(path, path.read_text()) for path in sources(module)}
    whole = SOURCE / "src" / module / "whole_module.cpp"
    text = "".join(f'#include "{path}"\n' for path in finders)
    flags = ["-xc++", "-std=c++20", f"-I{SOURCE}/include", f"-I{whole.parent}", "-I/usr/include/eigen3",
             f"-I{ROOT}/build/release/lcmtypes", f"-I{ROOT}/build/release/src/generated",
             "-DEIGEN_MAX_ALIGN_BYTES=16", "-DFMT_SHARED", "-include", "optional", "-ferror-limit=0",
             "-isystem", "/usr/lib/llvm-14/lib/clang/14.0.6/include"]
    unit = ci.Index.create().parse(str(whole), args=flags, unsaved_files=[(str(whole), text)])
    fatal = [d for d in unit.diagnostics if d.severity >= 4]  # clang 14 is stricter than g++ here and there
    if fatal:
        raise RuntimeError(f"{module}: {fatal[0]}; is build/release built?")
    for child in unit.cursor.get_children():
        finder = child.location.file and finders.get(os.path.realpath(child.location.file.name))
        if finder:
            finder.visit(child, None)
    return [m for finder in finders.values()
            for m in {(m.start, m.end, m.what): m for m in finder.found}.values()]


def find_all(modules):
    with multiprocessing.Pool() as pool:
        return dict(zip(modules, pool.map(find, modules, chunksize=1)))


def draw(found, count, seed):
    """So many mutants in all, by the modules' shares; never two at exactly one place.

    Each kind of error is drawn as often as any other: places for an exchanged field are many, those
    for an early return are few.

    A mutant's lot depends on its own line alone: an edit elsewhere does not draw anew.
    """
    total = sum(len(v) for v in found.values())
    chosen = []
    for module, mutants in found.items():
        met = collections.Counter()
        by_kind = collections.defaultdict(list)
        for m in mutants:
            key = f"{seed} {m.file} {m.line_text} {m.text} {m.what}"
            met[key] += 1
            lot = hashlib.sha256(f"{key} {met[key]}".encode()).digest()
            by_kind[kind_of(m.what)].append((lot, m))
        for lots in by_kind.values():
            lots.sort(key=lambda lot: lot[0], reverse=True)
        wanted, taken = max(10, round(count * len(mutants) / total)), set()
        kinds = sorted(by_kind, key=lambda kind: hashlib.sha256(f"{seed} {kind}".encode()).digest())
        while wanted and any(by_kind.values()):
            for kind in kinds:
                if not (wanted and by_kind[kind]):
                    continue
                _, m = by_kind[kind].pop()
                if (m.file, m.start, m.end) not in taken:
                    taken.add((m.file, m.start, m.end))
                    chosen.append((module, m))
                    wanted -= 1
    return chosen


def kind_of(what):
    """What operator an error is of, whatever it is applied to."""
    for kind in ("dropped", "exchanged", "early return", "left out", "never true", "swapped", "lost",
                 "reversed", " for "):
        if kind in what:
            return kind
    return "number" if re.match(r"[0-9]", what) else "symbol"


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
