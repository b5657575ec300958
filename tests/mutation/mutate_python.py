#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""Deliberate errors in the Python package: every one that its syntax tree offers, one at a time, each
against tests/python/package_test.py. What survives is printed, and at last how many were noticed.

    ./ves test                              builds build/release
    tests/mutation/mutate_python.py         9 min for 371 errors on two processors that do other work too
"""
import argparse
import ast
import concurrent.futures
import os
import pathlib
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "build/release/python-module/ves"
OTHER = {ast.Lt: "<=", ast.LtE: "<", ast.Gt: ">=", ast.GtE: ">", ast.Eq: "!=", ast.NotEq: "==",
         ast.In: "not in", ast.NotIn: "in", ast.Is: "is not", ast.IsNot: "is",
         ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*", ast.And: "or", ast.Or: "and"}


class Finder(ast.NodeVisitor):
    def __init__(self, text):
        self.text, self.found = text, []
        self.starts = [0]
        for line in text.encode().splitlines(keepends=True):
            self.starts.append(self.starts[-1] + len(line))

    def span(self, node):
        return self.starts[node.lineno - 1] + node.col_offset, self.starts[node.end_lineno - 1] + node.end_col_offset

    def add(self, node, what, new, *between):
        """`new` instead of the node, or of what stands between two nodes."""
        a, b = (self.span(between[0])[1], self.span(between[1])[0]) if between else self.span(node)
        if not between or not set("()") & set(self.text[a:b]):
            self.found.append((node.lineno, what, a, b, new))

    def source(self, node):
        return ast.get_source_segment(self.text, node)

    def visit_If(self, node):
        self.add(node.test, "condition never true", "False")
        self.add(node.test, "condition negated", f"not ({self.source(node.test)})")
        self.generic_visit(node)

    visit_IfExp = visit_If

    def visit_Compare(self, node):
        if len(node.ops) == 1 and type(node.ops[0]) in OTHER:
            self.add(node, "relation turned", f" {OTHER[type(node.ops[0])]} ", node.left, node.comparators[0])
        elif len(node.ops) > 1:
            self.add(node, "relation left out", self.source(node.left) + " == " + self.source(node.left))
        self.generic_visit(node)

    def visit_BinOp(self, node):
        if type(node.op) in OTHER:
            self.add(node, "operator turned", f" {OTHER[type(node.op)]} ", node.left, node.right)
        self.generic_visit(node)

    def visit_BoolOp(self, node):
        self.add(node, "operator turned", f" {OTHER[type(node.op)]} ", *node.values[:2])
        self.generic_visit(node)

    def visit_Constant(self, node):
        if type(node.value) in (int, float):
            self.add(node, "another number", repr(1.25 * node.value if type(node.value) is float and node.value else node.value + 1))

    def visit_Call(self, node):
        if len(node.args) > 1:
            one, two = node.args[:2]
            (a, _), (_, b) = self.span(one), self.span(two)
            self.found.append((node.lineno, "arguments exchanged", a, b, f"{self.source(two)}, {self.source(one)}"))
        self.generic_visit(node)

    def visit_Raise(self, node):
        self.add(node, "refusal left out", "pass")

    def visit_Return(self, node):
        if node.value is not None:
            self.add(node, "nothing returned", "return None")
        self.generic_visit(node)

    def visit_Expr(self, node):
        if not isinstance(node.value, ast.Constant):  # a docstring
            self.add(node, "statement left out", "pass")
            self.generic_visit(node)

    def visit_JoinedStr(self, node):  # Python 3.11 does not know where its parts stand
        pass

    def visit_FunctionDef(self, node):  # not what is said of it
        for part in (*node.args.defaults, *node.body):
            self.visit(part)


def survives(text, mutant):
    _, _, a, b, new = mutant
    with tempfile.TemporaryDirectory() as folder:
        package = pathlib.Path(folder) / "ves"
        package.mkdir()
        for file in PACKAGE.iterdir():
            if file.is_file() and file.name != "__init__.py":
                (package / file.name).symlink_to(file)
        whole = text.encode()
        (package / "__init__.py").write_bytes(whole[:a] + new.encode() + whole[b:])
        try:
            test = subprocess.run(
                ["/usr/bin/python3", ROOT / "tests/python/package_test.py", "--build", ROOT / "build/release", "-f"],
                env={**os.environ, "PYTHONPATH": folder, "PYTHONDONTWRITEBYTECODE": "1"}, cwd=folder,
                stdin=subprocess.DEVNULL, capture_output=True, timeout=120)
        except subprocess.TimeoutExpired:
            return False
        return test.returncode == 0


def main():
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    text = (ROOT / "python/ves/__init__.py").read_text()
    if not survives(text, (0, "", 0, 0, "")):
        sys.exit("the package's tests fail without any error in it; is build/release built?")
    finder = Finder(text)
    finder.visit(ast.parse(text))
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        alive = [m for m, lives in zip(finder.found, pool.map(lambda m: survives(text, m), finder.found)) if lives]
    for line, what, a, b, new in alive:
        print(f"python/ves/__init__.py:{line}: {what}: {text.encode()[a:b].decode()[:60]!r} to {new[:60]!r}")
    print(f"{len(finder.found) - len(alive)} of {len(finder.found)} noticed")


if __name__ == "__main__":
    main()
