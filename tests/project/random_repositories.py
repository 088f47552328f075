"""Small random repositories: palettes at several depths, trees in several files, includes, settings, packages, and errors."""

import random
from pathlib import Path

TAGS = ("Fly", "Land", "Hover", "Look", "Grip")
SETTINGS = {
    "models": 'models = ["described.xml"]\n',
    "palette": 'models = ["nav2:jazzy"]\n',
    "include-path": 'include-path = ["shared"]\n',
    "trees": '[project]\ntrees = ["**/trees/*.xml"]\n',
    "btcpp": '[language]\nbtcpp = "4.8"\n',
    "findings": '[findings]\nneedless-node = "off"\nunread-key = "error"\n',
    "nodes": 'nodes = ["leaves_that_are_nowhere"]\n',
    "a mistake": "[findings]\nno-such-finding = 1\n",
}
MISTAKES = {
    "an unknown node": '<Flyy to="1"/>',
    "a node that nobody describes": "<Whatever/>",
    "an unknown tree": '<SubTree ID="Nowhere"/>',
    "an unknown attribute": '<AlwaysSuccess tries="3"/>',
    "a wrong value": '<Sleep msec="soon"/>',
    "a missing child": "<Inverter/>",
    "a missing attribute": "<Timeout><AlwaysSuccess/></Timeout>",
    "a wrong script": '<Script code="a := := 1"/>',
    "an unread key": '<Script code="unread := 1"/>',
    "an unwritten key": '<ScriptCondition code="unwritten == 1"/>',
    "a needless node": "<Sequence><AlwaysSuccess/></Sequence>",
    "a circle": '<SubTree ID="T0"/>',
    "a node of Nav2": '<FollowPath path="{path}"/>',
}


def palette(tags, chance):
    """Return a random palette. The palettes of a repository may describe a node differently."""
    ports = "".join(f'<input_port name="{name}"/>' for name in ("to", "at") if chance.random() < 0.7)
    described = "".join(
        f'<{chance.choice(("Action", "Condition"))} ID="{tag}">{ports}</{{}}>' for tag in tags
    )
    parts = described.split("</{}>")
    closed = "".join(f"{part}</{part[1:].split()[0]}>" for part in parts if part)
    return f'<root BTCPP_format="4"><TreeNodesModel>{closed}</TreeNodesModel></root>\n'


class Repository:
    """A random repository.

    Args:
        folder: The folder to create.
        seed: The seed of the random choices.

    Attributes:
        folder: The folder.
        trees: Its tree files, including the palettes.
        has: The names of the features that it contains.
    """

    def __init__(self, folder: Path, seed: int) -> None:
        chance = random.Random(seed)  # noqa: S311 - the same in every run
        self.folder, self.has = folder, set[str]()
        self._chance, self.trees = chance, list[Path]()
        (folder / ".git").mkdir(parents=True)
        packages = ["", *chance.sample(["one/", "two/", "one/inner/"], chance.randint(0, 3))]
        for package in packages[1:]:
            self._write(f"{package}package.xml", "<package/>\n")
            self.has.add("a nested package" if package.count("/") > 1 else "a package")
        folders = [f"{package}{below}" for package in packages for below in ("", "trees/", "trees/deep/")]
        for _ in range(chance.choice((0, 1, 1, 2, 3))):
            name = f"{chance.choice(folders)}nodes.{chance.choice(('xml', 'xml', 'btproj'))}"
            self._write(name, palette(chance.sample(TAGS, chance.randint(1, 4)), chance))
            self.has.add(f"a palette at depth {name.count('/')}")
        self._configure(chance.choice(packages))
        count = chance.randint(2, 4)
        for number in range(count):
            self._tree(chance.choice(folders), number, count)

    def _write(self, name: str, text: str) -> None:
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        if (
            path.suffix == ".xml"
            and path.name not in ("package.xml", ".described.xml")
            and path not in self.trees
        ):
            self.trees.append(path)

    def _configure(self, package: str) -> None:
        keys = self._chance.sample(sorted(SETTINGS), self._chance.choice((0, 0, 1, 1, 2)))
        written = dict.fromkeys(
            SETTINGS[key] for key in sorted(keys, key=lambda key: SETTINGS[key][0] == "[")
        )
        if len({"models", "palette"} & {*keys}) < 2:
            self.has |= {f"the setting {key}" for key in keys}
            if keys:
                self._write(f"{package}sar.toml", "".join(written))
            if "models" in keys:
                self._write(f"{package}described.xml", palette(TAGS[:2], self._chance))

    def _tree(self, folder: str, number: int, count: int) -> None:
        chance = self._chance
        body = [f'<{tag} to="1"/>' for tag in chance.sample(TAGS, chance.randint(0, 2))]
        if number + 1 < count:
            body.append(f'<SubTree ID="T{chance.randint(number + 1, count - 1)}"/>')
            self.has.add("a set of trees")
        if chance.random() < 0.8:
            name = chance.choice(sorted(MISTAKES))
            body.append(MISTAKES[name])
            self.has.add(name)
        include = ""
        if self.trees and chance.random() < 0.3:
            up = "../" * folder.count("/")
            include = (
                f'<include path="{up}{chance.choice(self.trees).relative_to(self.folder).as_posix()}"/>\n'
            )
            self.has.add("an include")
        main = chance.choice(("", f' main_tree_to_execute="T{number}"'))
        nodes = "\n".join(["<AlwaysSuccess/>", *body])
        text = f'<root BTCPP_format="4"{main}>\n{include}<BehaviorTree ID="T{number}">\n<Sequence>\n{nodes}\n</Sequence>\n</BehaviorTree>\n</root>\n'
        if chance.random() < 0.05:
            text = text.replace("</Sequence>", "")
            self.has.add("a malformed file")
        self._write(f"{folder}t{number}.xml", text)
