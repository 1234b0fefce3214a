"""Holds the JSON Schemas that editors use against the reader, with Python's own TOML and JSON Schema.

Every config named is valid by its schema. Then each is broken, one key at a time, and `beamcast lint` and the schema
judge what comes out: the schema may never refuse what lint takes, and both must refuse what is of the wrong kind, unknown,
missing, or not one of the words. Every word that the schema allows is one that lint takes.

    python tests/schema/check.py BEAMCAST CONFIG...
"""

import copy
import json
import pathlib
import subprocess
import sys
import tempfile
import tomllib

import jsonschema

SCHEMAS = pathlib.Path(__file__).parents[2] / "configs" / "schema"
WRONG_KINDS = ["text", 0.5, True, [], {}, ["text"], [0.25], -1]


def is_number(_, value):
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def validator(kind):
    schema = json.loads((SCHEMAS / f"{kind}.json").read_text())
    jsonschema.Draft7Validator.check_schema(schema)
    # JSON Schema counts 1.0 as an integer, TOML doesn't.
    types = jsonschema.Draft7Validator.TYPE_CHECKER.redefine(
        "integer", lambda _, value: isinstance(value, int) and not isinstance(value, bool)
    ).redefine("number", is_number)
    return jsonschema.validators.extend(jsonschema.Draft7Validator, type_checker=types)(schema)


def to_toml(value):
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(k)} = {to_toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(to_toml, value)) + "]"
    return json.dumps(value) if isinstance(value, str) else repr(value)


# Times that may lie outside of a trajectory, which no schema knows.
TIMES = ("t_s", "trigger_s", "start_s")


# Words of which one makes other keys of its table meaningless, which are then refused; no schema knows.
ALTERNATIVES = ("detector", "layout")
# Channels of depth cameras, which a job of other sensors can't choose; no schema knows.
OF_DEPTH_CAMERAS = (
    "ambient",
    "amplitude",
    "confidence",
    "disparity",
    "ir.left",
    "ir.right",
    "phase.1",
    "phase.2",
    "phase.3",
)


def keys(value, path=()):
    """The path of every key, and of the elements of lists of tables."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield (*path, key)
            yield from keys(inner, (*path, key))
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        for index, inner in enumerate(value):
            yield from keys(inner, (*path, index))


def at(value, path):
    for step in path:
        value = value[step]
    return value


def schema_at(schema, path):
    """What the schema says at a path, as far as plain properties and items lead."""
    for step in path:
        found = schema.get("properties", {}).get(step) if isinstance(step, str) else schema.get("items")
        if found is None:
            found = next((s["properties"][step] for s in schema.get("anyOf", []) if step in s.get("properties", {})), {})
        schema = found
    return schema


def mutations(config, schema):
    """Each as: what was done, the config, and whether the schema and lint must agree on it."""
    for path in list(keys(config)):
        name = ".".join(map(str, path))

        def changed(new, path=path):
            mutant = copy.deepcopy(config)
            parent = at(mutant, path[:-1])
            if new is None:
                del parent[path[-1]]
            else:
                parent[path[-1]] = new
            return mutant

        yield f"without {name}", changed(None), False
        for wrong in WRONG_KINDS:
            told = schema_at(schema, path)
            plain = isinstance(wrong, (str, bool)) or wrong == -1 or (wrong == 0.5 and told.get("type") == "integer")
            if wrong == -1 and path[-1] in TIMES:
                plain = False
            agree = plain and type(wrong) is not type(at(config, path)) and "enum" not in told and "anyOf" not in told
            yield f"{name} = {wrong!r}", changed(wrong), agree and bool(told)
        words = schema_at(schema, path)
        for word in words.get("enum", words.get("items", {}).get("enum", [])):
            agree = path[-1] not in ALTERNATIVES and word not in OF_DEPTH_CAMERAS
            yield f"{name} = {word}", changed([word] if words["type"] == "array" else word), agree
        unknown = changed(at(config, path))
        at(unknown, path[:-1])["no_such_key"] = 1
        yield f"{name[:-len(str(path[-1]))]}no_such_key", unknown, path[:-1] != ("labels",)


def moved(value, folder):
    """The value with whole paths for all strings that name files in a folder."""
    if isinstance(value, dict):
        return {key: moved(inner, folder) for key, inner in value.items()}
    if isinstance(value, list):
        return [moved(inner, folder) for inner in value]
    if isinstance(value, str) and (folder / value).is_file():
        return str((folder / value).resolve())
    return value


def main(beamcast, configs):
    wrong = []
    tried = 0
    for config in map(pathlib.Path, configs):
        value = tomllib.loads(config.read_text())
        kind = "job" if "scene" in value else "sensor"
        check = validator(kind)
        wrong += [f"{config}: {error.json_path}: {error.message}" for error in check.iter_errors(value)]
        schema_line = config.read_text().splitlines()[0].removeprefix("#:schema ")
        if (config.parent / schema_line).resolve() != (SCHEMAS / f"{kind}.json").resolve():
            wrong.append(f"{config}: its first line is not #:schema and the way to configs/schema/{kind}.json")
        mutants = list(mutations(value, check.schema))
        with tempfile.TemporaryDirectory() as folder:  # lint reads a folder's files at once
            for index, (_, mutant, _) in enumerate(mutants):
                mutant = moved(mutant, config.parent)
                text = "".join(f"{json.dumps(k)} = {to_toml(v)}\n" for k, v in mutant.items())
                pathlib.Path(folder, f"{index:05}.toml").write_text(text)
            lint = subprocess.run([beamcast, "lint", "--json", folder], capture_output=True, text=True, check=False)
            told = json.loads(lint.stdout)["diagnostics"]
        refused = {pathlib.Path(d["path"]).name for d in told if d["severity"] == "error"}
        for index, (name, mutant, must_agree) in enumerate(mutants):
            tried += 1
            by_lint, by_schema = f"{index:05}.toml" in refused, not check.is_valid(mutant)
            if by_schema and not by_lint:
                wrong.append(f"{config}, {name}: the schema refuses what lint takes")
            elif must_agree and by_lint and not by_schema:
                wrong.append(f"{config}, {name}: lint refuses what the schema takes")
    print("\n".join(wrong) or f"{len(configs)} configs are valid, and {tried} broken ones judged alike.")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2:]))
