# SPDX-License-Identifier: BSD-3-Clause
"""The JSON Schema of `ves keys --schema`: every shipped file is valid by it, and two hundred files
with one error each are not. Who validates is python3-jsonschema, which knows nothing of ves."""

import argparse
import copy
import json
import pathlib
import random
import re
import subprocess
import sys

import jsonschema
import yaml

ROOT = pathlib.Path(__file__).resolve().parents[2]
# Which part of a scenario the files are.
PARTS = {"ves.yaml": "", "scenarios/*": "", "platforms/*": "", "bases/*": "base", "robots/*": "robot", "arms/srms*": "base/arm"}


class Loader(yaml.SafeLoader):
    """YAML as editors read it: tags of ours say where a number was got. A number is what YAML 1.2
    takes for one: 1e6 too."""


def untagged(loader, _, node):
    if isinstance(node, yaml.ScalarNode):
        return loader.construct_object(yaml.ScalarNode(loader.resolve(yaml.ScalarNode, node.value, (True, False)), node.value))
    if isinstance(node, yaml.SequenceNode):
        return loader.construct_sequence(node, deep=True)
    return loader.construct_mapping(node, deep=True)


Loader.add_multi_constructor("!", untagged)
Loader.add_implicit_resolver("tag:yaml.org,2002:float", re.compile(
    r"^[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?$"), list("-+.0123456789"))


def part(schema, path):
    for key in filter(None, path.split("/")):
        schema = schema["properties"][key]
    return jsonschema.Draft7Validator(schema)


def places(value, path=()):
    """Every map and every leaf below, by its path."""
    if isinstance(value, dict):
        yield path, value
        for key, child in value.items():
            yield from places(child, path + (key,))
    elif isinstance(value, list):
        for i, child in enumerate(value):
            yield from places(child, path + (i,))
    else:
        yield path, value


def spoilt(document, rng):
    """One error of a tired author: a key misspelt, or a value that is none."""
    out = copy.deepcopy(document)
    all_places = [(p, v) for p, v in places(out) if p and "from" not in p and "pose_deg" not in p and "lock" not in p]
    path, value = rng.choice(all_places)
    parent = out
    for key in path[:-1]:
        parent = parent[key]
    if isinstance(value, dict):
        parent[path[-1]][rng.choice(["masss_kg", "duration", "to_mm"])] = 1
        return out, f"{path}: a key that nobody knows"
    if isinstance(value, bool):
        parent[path[-1]] = "perhaps"
    elif isinstance(value, (int, float)):
        parent[path[-1]] = "a lot"
    else:
        parent[path[-1]] = {"a": "map"}
    return out, f"{path}: {value!r} -> {parent[path[-1]]!r}"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--build", required=True)
    build = pathlib.Path(parser.parse_args().build)
    schema = json.loads(subprocess.run([build / "apps/ves", "keys", "--schema"], check=True, capture_output=True,
                                       env={"VES_CONFIG_DIR": str(ROOT / "config"), "PATH": ""}).stdout)
    jsonschema.Draft7Validator.check_schema(schema)
    failures, documents = [], []
    for files, path in PARTS.items():
        for file in sorted((ROOT / "config").glob(files)):
            if file.suffix != ".yaml":
                continue
            document = yaml.load(file.read_text(), Loader)
            validator = part(schema, path)
            for error in validator.iter_errors(document):
                failures.append(f"{file.name}: {list(error.absolute_path)}: {error.message[:200]}")
            documents.append((file.name, validator, document))
    rng = random.Random(1)
    for _ in range(200):
        name, validator, good = rng.choice(documents)
        bad, what = spoilt(good, rng)
        if validator.is_valid(bad):
            failures.append(f"{name}, {what}: valid")
    print(f"{len(documents)} files valid, 200 with an error refused" if not failures else "\n".join(failures))
    return bool(failures)


if __name__ == "__main__":
    sys.exit(main())
