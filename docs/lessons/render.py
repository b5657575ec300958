# SPDX-License-Identifier: BSD-3-Clause
"""Turns the lessons into pages: their text and equations, their code, what it prints and draws.

  render.py --out DIR [LESSON...]   HTML pages that need nothing else, by pandoc
  render.py --check LESSON          runs one, cell by cell, and writes nothing

A lesson is a plain Python program. `# %% [markdown]` begins a cell of text, `# %%` one of code, `# %% answer`
the code that answers the exercise before it.
"""
import argparse
import contextlib
import io
import pathlib
import re
import subprocess
import sys

import matplotlib
matplotlib.use("svg")
import matplotlib.pyplot as plt

HERE = pathlib.Path(__file__).resolve().parent
matplotlib.rcParams.update({"svg.hashsalt": "ves", "svg.fonttype": "none", "font.family": "DejaVu Sans",
                            "axes.spines.top": False, "axes.spines.right": False})

STYLE = """<style>
:root { color-scheme: light dark; --ink: #1b1f24; --soft: #444c56; --back: #ffffff; --code: #f3f5f7; --link: #0062a8; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6edf3; --soft: #a5afb9; --back: #12161b; --code: #1b2128;
       --link: #58a9f0; } }
body { font: 17px/1.55 "DejaVu Sans", system-ui, sans-serif; color: var(--ink); background: var(--back);
       max-width: 48rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.7rem; line-height: 1.2; } h2 { font-size: 1.2rem; margin-top: 2rem; }
pre, code { font: 13px/1.45 "DejaVu Sans Mono", monospace; }
pre, div.sourceCode { background: var(--code); padding: .7rem .9rem; overflow-x: auto; border-radius: 4px; }
pre.sourceCode { padding: 0; }
pre.out { background: none; border-left: 3px solid #8b98a5; border-radius: 0; color: var(--soft); }
svg { max-width: 100%; height: auto; background: #ffffff; border-radius: 4px; }
math { font-size: 1.1em; } math[display=block] { margin: 1rem 0; }
details { margin: 1rem 0; } summary { cursor: pointer; color: var(--link); }
nav { display: flex; justify-content: space-between; margin: 2.5rem 0; font-size: .9rem; } a { color: var(--link); }
@media (prefers-color-scheme: dark) { code span span { filter: invert(1) hue-rotate(180deg); } }
</style>"""


def cells(text):
    """(kind, source) of each: markdown, code or answer."""
    for part in re.split(r"^# %% ?", text, flags=re.M)[1:]:
        head, _, body = part.partition("\n")
        if head.strip() == "[markdown]":
            yield "markdown", "\n".join(line[2:] for line in body.splitlines())
        else:
            yield head.strip() or "code", body.strip()


def escaped(text):
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


def markdown(lesson):
    """The lesson as Markdown with what its code has printed and drawn. Raises what the code raises."""
    out, names, figures = [], {"__name__": "__main__"}, []

    def show():
        for number in plt.get_fignums():
            text = io.StringIO()
            plt.figure(number).savefig(text, format="svg", bbox_inches="tight", metadata={"Date": None})
            figures.append(re.sub(r"^.*?(?=<svg)", "", text.getvalue(), flags=re.S))
        plt.close("all")

    plt.show = show
    for kind, source in cells(lesson.read_text()):
        if kind == "markdown":
            out.append(source)
            continue
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(compile(source, str(lesson), "exec"), names)
        block = f"```python\n{source}\n```\n"
        if printed.getvalue().strip():
            block += f'\n<pre class="out">{escaped(printed.getvalue().rstrip())}</pre>\n'
        while figures:
            block += "\n```{=html}\n" + figures.pop(0) + "\n```\n"
        if kind == "answer":
            block = f"<details><summary>Answer</summary>\n\n{block}\n</details>\n"
        out.append(block)
    return "\n\n".join(out)


def render(lesson, others, folder):
    at = others.index(lesson)
    link = lambda i, word: (f'<a href="{others[i].stem}.html">{word}</a>'
                            if 0 <= i < len(others) else "<span></span>")
    page = (markdown(lesson) + f"\n\n<nav>{link(at - 1, 'the lesson before')}"
            f"<a href=\"index.html\">all of them</a>{link(at + 1, 'the next one')}</nav>\n")
    title = title_of(lesson)
    file = folder / f"{lesson.stem}.html"
    file.write_text(html(page, title, folder))
    return file


def title_of(lesson):
    return re.search(r"^# # (.*)", lesson.read_text(), flags=re.M).group(1)


def html(page, title, folder):
    style = folder / "style.html"
    style.write_text(STYLE)
    made = subprocess.run(["pandoc", "--from=markdown+raw_attribute+tex_math_dollars", "--to=html5", "--standalone",
                           "--mathml", "--highlight-style=pygments", f"--metadata=pagetitle:{title}",
                           f"--include-in-header={style}"],
                          input=page, text=True, check=True, capture_output=True)
    style.unlink()
    # Browsers set a combining accent beside its letter, and the accent alone above it.
    return made.stdout.replace("\u0308", "\u00a8").replace("\u0307", "\u02d9")


def index(lessons, folder):
    page = "# VES, in lessons\n\n" + "".join(f"* [{title_of(l)}]({l.stem}.html)\n" for l in lessons)
    (folder / "index.html").write_text(html(page, "VES, in lessons", folder))
    return folder / "index.html"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("lessons", nargs="*", type=pathlib.Path)
    how = parser.add_mutually_exclusive_group()
    how.add_argument("--out", type=pathlib.Path, default=pathlib.Path("ves-lessons"))
    how.add_argument("--check", action="store_true")
    given = parser.parse_args()
    every = sorted(HERE.glob("[0-9]*.py"))
    for lesson in given.lessons:
        if not lesson.is_file():
            sys.exit(f"lessons: {lesson}: no such file, want one of {', '.join(l.name for l in every)}")
    if not given.check:
        given.out.mkdir(parents=True, exist_ok=True)
    for lesson in [l.resolve() for l in given.lessons] or every:
        if given.check:
            markdown(lesson)
        else:
            print(render(lesson, every if lesson in every else [lesson], given.out))
    if not given.check and not given.lessons:
        print(index(every, given.out))


main()
