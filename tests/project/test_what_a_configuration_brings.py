"""Looking at somebody's trees runs none of his code, unless the user says so."""

import importlib
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from sar_compiler.checks.configuration import configuration_for
from sar_compiler.project.trust import ConfigurationCode
from tests.trees import document

VALID = "tree.xml: no findings\n"
METADATA = {
    "METADATA": "Metadata-Version: 2.1\nName: {name}\nVersion: 1\n",
    "entry_points.txt": "[sar_compiler.nodes]\ngripper = gripper\n",
}


def pretend_to_be_installed(folder, name="gripper", suffix="dist-info"):
    metadata = folder / f"{name}-1.{suffix}"
    metadata.mkdir(parents=True)
    for file, text in METADATA.items():
        wanted = "PKG-INFO" if file == "METADATA" and suffix == "egg-info" else file
        (metadata / wanted).write_text(text.format(name=name), encoding="utf-8")
    return metadata


@pytest.fixture
def named(checkout):
    """Return a checkout whose configuration names its own module of leaves."""
    checkout.write_leaves()
    checkout.configure('nodes = ["gripper"]\n')
    return checkout


class TestModulesThatAConfigurationNames:
    def test_are_not_imported_from_the_checkout(self, named):
        said = named.validate()
        assert (
            "sar.toml:1:11: error[untrusted-nodes]: the module 'gripper' is not trusted, because no installed package registers it"
            in said
        )
        assert "--nodes gripper" in said
        assert "--trust" in said
        assert "unknown-node" not in said
        assert not named.has_run

    def test_are_said_with_the_options_that_a_command_in_ci_needs(self, named):
        said = named.validate()
        options = re.search(r"add ((?:--nodes [\w.]+ ?)+) ?to the command, or first install", said)
        assert options is not None, said
        assert "untrusted-nodes" not in named.validate(*options[1].split())
        assert named.has_run

    @pytest.mark.parametrize("command", ["show", "simulate", "verify"])
    def test_are_not_imported_by_any_command(self, named, command):
        done = named.command(command, "tree.xml")
        assert done.returncode != 0
        assert "untrusted-nodes" in done.stderr
        assert not named.has_run

    @pytest.mark.parametrize("path", ["", ".", ":{folder}", "{folder}"])
    def test_are_not_imported_wherever_sys_path_leads(self, named, path):
        said = named.validate(PYTHONPATH=path.format(folder=named.folder))
        assert "untrusted-nodes" in said
        assert not named.has_run

    @pytest.mark.parametrize("above", [1, 2])
    @pytest.mark.parametrize("package", [True, False])
    def test_are_not_imported_as_parts_of_a_package_that_is_the_checkout(self, named, above, package):
        """As where `PYTHONPATH` has the folder with all of a user's checkouts."""
        if package:
            named.write("__init__.py", "")
        folders = [named.folder, *named.folder.parents]
        module = ".".join([*(folder.name for folder in reversed(folders[:above])), "gripper"])
        named.configure(f'nodes = ["{module}"]\n')
        said = named.validate(PYTHONPATH=str(folders[above]))
        assert "untrusted-nodes" in said
        assert not named.has_run

    def test_are_imported_when_what_is_installed_lies_above_the_trees(self, named, tmp_path):
        """As of a package that `pip install --target` has put somewhere with its trees."""
        site = tmp_path / "site"
        (site / "robot").mkdir(parents=True)
        shutil.move(named.folder, site / "robot" / "trees")
        shutil.move(site / "robot" / "trees" / "gripper.py", site / "robot")
        named.folder = site / "robot" / "trees"
        named.configure('nodes = ["robot.gripper"]\n')
        metadata = pretend_to_be_installed(site)
        (metadata / "entry_points.txt").write_text(
            "[sar_compiler.nodes]\ng = robot.gripper\n", encoding="utf-8"
        )
        assert named.validate(PYTHONPATH=str(site)) == VALID

    @pytest.mark.parametrize("question", [["nodes", "Grip"], ["schema"], ["schema", "--format", "json"]])
    def test_count_where_it_is_asked_what_can_be_written(self, named, question):
        done = named.command(*question)
        assert (done.returncode, done.stdout) == (1, "")
        assert "sar.toml:1:11: error[untrusted-nodes]" in done.stderr
        assert not named.has_run
        done = named.command(*question, "--trust")
        assert done.returncode == 0
        assert "Grip" in done.stdout

    def test_are_not_imported_from_the_current_folder_either(self, named, tmp_path):
        elsewhere = tmp_path / "elsewhere"
        elsewhere.mkdir()
        shutil.move(named.folder / "gripper.py", elsewhere / "gripper.py")
        named.write_leaves("gripper.py").unlink()
        tree = named.folder / "tree.xml"
        named.folder = elsewhere
        done = named.command("validate", tree, PYTHONPATH=os.pathsep)
        assert "untrusted-nodes" in done.stdout
        assert not named.has_run

    def test_are_imported_when_the_user_names_them_himself(self, named):
        assert named.validate("--nodes", "gripper") == VALID
        assert named.has_run

    def test_are_imported_when_they_are_installed(self, named, tmp_path):
        site = tmp_path / "site"
        site.mkdir()
        shutil.move(named.folder / "gripper.py", site)
        assert "untrusted-nodes" in named.validate(PYTHONPATH=str(site))
        pretend_to_be_installed(site)
        assert named.validate(PYTHONPATH=str(site)) == VALID

    def test_are_taken_from_what_is_installed_and_not_from_the_checkout(self, named, tmp_path):
        site = tmp_path / "site"
        site.mkdir()
        (site / "gripper.py").write_text(
            (named.folder / "gripper.py")
            .read_text("utf-8")
            .replace("it has run", "the installed one has run")
        )
        pretend_to_be_installed(site)
        assert named.validate(PYTHONPATH=os.pathsep.join(["", str(site)])) == VALID
        assert named.proof.read_text("utf-8") == "the installed one has run"

    def test_are_looked_for_beside_a_configuration_that_is_only_linked(self, named, tmp_path):
        shutil.move(named.folder / "sar.toml", tmp_path / "sar.toml")
        (named.folder / "sar.toml").symlink_to(tmp_path / "sar.toml")
        assert "untrusted-nodes" in named.validate(PYTHONPATH=str(named.folder))
        assert named.validate("--trust") == VALID

    @pytest.mark.parametrize(
        "module",
        [
            "antigravity",
            "test.autotest",
            "test.crashers.gc_inspection",
            "pytest",
            "py_trees",
            "gripper/../x",
            "",
            "gripper.py",
        ],
    )
    def test_that_are_of_no_package_with_leaves_are_not_imported_though_they_are_installed(
        self, checkout, module
    ):
        checkout.configure(f'nodes = ["{module}"]\n')
        said = checkout.validate()
        assert (
            f"untrusted-nodes]: the module '{module}' is not trusted, because no installed package registers it"
            in said
        )

    def test_are_not_imported_from_another_distribution_s_part_of_a_namespace(self, named, tmp_path):
        site = tmp_path / "site"
        for part in ("mine", "others"):
            (site / "acme" / part).mkdir(parents=True)
            shutil.copy(named.folder / "gripper.py", site / "acme" / part / "gripper.py")
        metadata = pretend_to_be_installed(site)
        (metadata / "entry_points.txt").write_text(
            "[sar_compiler.nodes]\ng = acme.mine.gripper\n", encoding="utf-8"
        )
        named.configure('nodes = ["acme.others.gripper"]\n')
        assert "untrusted-nodes" in named.validate(PYTHONPATH=str(site))
        named.configure('nodes = ["acme.mine.gripper"]\n')
        assert named.validate(PYTHONPATH=str(site)) == VALID

    def test_are_all_named_at_once(self, named):
        named.configure('nodes = ["gripper", "arm"]\n')
        assert named.validate().count("error[untrusted-nodes]") == 2


class TestTrust:
    def test_runs_the_modules_beside_the_configuration_and_is_remembered(self, named):
        assert named.validate("--trust") == VALID
        assert named.validate() == VALID
        (record,) = (named.home / "state/sar_compiler/trusted").iterdir()
        assert record.read_text("utf-8") == f"{named.folder / 'sar.toml'}\n"

    def test_is_kept_below_the_home_folder_by_default(self, named):
        assert named.validate("--trust", XDG_STATE_HOME="relative") == VALID
        assert len(list((named.home / ".local/state/sar_compiler/trusted").iterdir())) == 1

    def test_is_lost_when_a_module_changes(self, named):
        named.validate("--trust")
        named.proof.unlink()
        named.write("gripper.py", (named.folder / "gripper.py").read_text("utf-8") + "\n")
        assert "untrusted-nodes" in named.validate()
        assert not named.has_run

    def test_is_lost_when_the_configuration_changes(self, named):
        named.validate("--trust")
        named.configure('nodes = ["gripper"]\n\n')
        assert "untrusted-nodes" in named.validate()

    def test_is_lost_when_the_checkout_is_moved(self, named):
        named.validate("--trust")
        named.folder = named.folder.rename(named.folder.parent / "moved")
        assert "untrusted-nodes" in named.validate()

    def test_is_lost_when_anything_in_a_package_changes(self, checkout):
        checkout.write("robot/__init__.py", "from robot.inner.leaves import Grip\n")
        checkout.write("robot/inner/helper.py", "")
        checkout.write_leaves("robot/inner/leaves.py")
        checkout.configure('nodes = ["robot"]\n')
        assert checkout.validate("--trust") == VALID
        assert checkout.validate() == VALID
        checkout.write("robot/inner/helper.py", "import os\n")
        assert "untrusted-nodes" in checkout.validate()

    def test_is_not_lost_by_what_python_compiles(self, checkout):
        checkout.write_leaves("gripper/__init__.py")
        checkout.configure('nodes = ["gripper"]\n')
        checkout.validate("--nodes", "gripper")
        assert (checkout.folder / "gripper/__pycache__").exists()
        assert checkout.validate("--trust") == VALID
        shutil.rmtree(checkout.folder / "gripper/__pycache__")
        assert checkout.validate() == VALID

    def test_is_for_the_source_and_not_for_what_is_compiled_beside_it(self, checkout):
        package = checkout.write(
            "robot/__init__.py", "import robot.leaves\nfrom robot.leaves import Grip\n"
        ).parent
        leaves = checkout.write_leaves("robot/leaves.py")
        good = leaves.read_bytes()
        evil = good.replace(b"it has run", b"it is evil")
        checkout.configure('nodes = ["robot"]\n')
        # Compiled from another source of the same size and age.
        leaves.write_bytes(evil)
        moment = leaves.stat().st_mtime_ns
        done = checkout.command("validate", "tree.xml", "--nodes", "robot")
        assert done.returncode == 0
        assert list(package.glob("__pycache__/leaves.*"))
        leaves.write_bytes(good)
        os.utime(leaves, ns=(moment, moment))
        assert checkout.validate("--trust") == VALID
        assert checkout.proof.read_text("utf-8") == "it has run"

    def test_does_not_reach_a_module_beside_those_that_are_named(self, checkout):
        checkout.write_leaves("helper.py")
        checkout.write("robot.py", "from helper import Grip\n")
        checkout.configure('nodes = ["robot"]\n')
        done = checkout.command("validate", "tree.xml", "--trust")
        assert done.returncode == 2
        assert "No module named 'helper'" in done.stderr
        assert not checkout.has_run

    @pytest.mark.parametrize("link", ["robot", "robot/inner"])
    def test_does_not_reach_what_is_only_linked(self, checkout, tmp_path, link):
        outside = tmp_path / "outside"
        outside.mkdir()
        (checkout.folder / "robot").mkdir()
        shutil.move(checkout.write_leaves("leaves.py"), outside / "leaves.py")
        if link == "robot":
            (checkout.folder / "robot").rmdir()
        (checkout.folder / link).symlink_to(outside)
        module = f"{link.replace('/', '.')}.leaves"
        checkout.configure(f'nodes = ["{module}"]\n')
        done = checkout.command("validate", "tree.xml", "--trust")
        assert done.returncode == 2
        assert "is not part of the trusted code" in done.stderr
        assert not checkout.has_run

    @pytest.mark.parametrize("is_link", [False, True])
    def test_ends_where_a_module_is_exchanged_after_its_hash_was_taken(self, tmp_path, monkeypatch, is_link):
        monkeypatch.setattr(sys, "meta_path", [*sys.meta_path])
        (tmp_path / "exchanged_gripper.py").write_text("VALUE = 'trusted'\n", encoding="utf-8")
        (tmp_path / "sar.toml").write_text("", encoding="utf-8")
        content = ConfigurationCode.from_configuration(tmp_path / "sar.toml", ["exchanged_gripper"])
        content.make_importable()
        evil = "raise SystemExit('it has run')\n"
        if is_link:
            (tmp_path / "evil.py").write_text(evil, encoding="utf-8")
            (tmp_path / "exchanged_gripper.py").unlink()
            (tmp_path / "exchanged_gripper.py").symlink_to("evil.py")
        else:
            (tmp_path / "exchanged_gripper.py").write_text(evil, encoding="utf-8")
        with pytest.raises(ImportError, match=r"exchanged_gripper\.py has changed since it was trusted"):
            importlib.import_module("exchanged_gripper")

    def test_that_cannot_be_recorded_is_said(self, named):
        (named.home / "state").write_text("a file")
        done = named.command("validate", "tree.xml", "--trust")
        assert done.returncode == 2
        assert "cannot record that" in done.stderr
        assert not named.has_run


class TestNamesakesOfLibraries:
    @pytest.mark.parametrize("path", [":{elsewhere}", "{elsewhere}:", ".:{elsewhere}", "{folder}"])
    @pytest.mark.parametrize("library", ["jsonschema", "json"])
    def test_in_the_current_folder_are_not_imported(self, checkout, tmp_path, library, path):
        """A workspace's `PYTHONPATH` often ends with an empty part, which means the current folder."""
        checkout.write_leaves(f"{library}.py")
        checkout.configure('[findings]\nunused-port = "off"\n')
        variable = path.format(elsewhere=tmp_path / "elsewhere", folder=checkout.folder)
        checkout.validate(PYTHONPATH=variable)
        assert not checkout.has_run

    def test_leave_what_the_user_names_where_it_is(self, checkout):
        shutil.move(checkout.write_leaves(), checkout.write("src/here.txt", "").parent)
        assert checkout.validate("--nodes", "gripper", PYTHONPATH="src") == VALID
        assert checkout.has_run


class TestEntryPoints:
    @pytest.mark.parametrize("suffix", ["dist-info", "egg-info"])
    def test_of_what_only_looks_installed_in_the_checkout_are_passed_over(self, checkout, suffix):
        checkout.write_leaves()
        pretend_to_be_installed(checkout.folder, suffix=suffix)
        done = checkout.command("validate", "tree.xml", PYTHONPATH="")
        said = checkout.validate(PYTHONPATH=os.pathsep)
        assert done.returncode == 1
        assert "unknown-node" in said
        assert f"note: the leaves of 'gripper' are ignored: {checkout.folder} declares" in said
        assert not checkout.has_run

    def test_below_the_checkout_are_passed_over(self, checkout):
        checkout.write_leaves("lib/gripper.py")
        pretend_to_be_installed(checkout.folder / "lib")
        assert "are ignored" in checkout.validate(PYTHONPATH=str(checkout.folder / "lib"))
        assert not checkout.has_run

    def test_by_a_path_from_where_one_happens_to_be_are_passed_over(self, checkout, tmp_path):
        elsewhere = tmp_path / "elsewhere"
        pretend_to_be_installed(elsewhere / "lib")
        shutil.move(checkout.write_leaves(), elsewhere / "lib")
        tree, checkout.folder = checkout.folder / "tree.xml", elsewhere
        assert "are ignored" in checkout.command("validate", tree, PYTHONPATH="lib").stderr
        assert not checkout.has_run

    def test_of_palettes_are_not_imported_for_a_hint(self, checkout):
        """A misspelt tag in a folder of a checkout, of which the path has the folder above."""
        checkout.write_leaves()
        metadata = pretend_to_be_installed(checkout.folder)
        (metadata / "entry_points.txt").write_text("[sar_compiler.palettes]\ngripper = gripper\n")
        checkout.write("trees/tree.xml", document("<RecoveryNode/>"))
        root, checkout.folder = checkout.folder, checkout.folder / "trees"
        said = checkout.validate(PYTHONPATH=str(root))
        assert "add a palette that describes it: --model nav2:jazzy" in said
        assert not checkout.has_run

    def test_cannot_take_the_place_of_what_is_installed(self, checkout):
        checkout.write("tree.xml", document("<NavigateToBase/>"))
        metadata = pretend_to_be_installed(checkout.folder, "sar_compiler")
        (metadata / "entry_points.txt").write_text("[sar_compiler.nodes]\n", encoding="utf-8")
        assert checkout.validate(PYTHONPATH=os.pathsep) == VALID

    def test_that_are_a_pipe_keep_nobody_waiting(self, checkout):
        metadata = pretend_to_be_installed(checkout.folder, "sar_compiler")
        (metadata / "entry_points.txt").unlink()
        os.mkfifo(metadata / "entry_points.txt")
        checkout.write("tree.xml", document("<NavigateToBase/>"))
        assert checkout.validate(PYTHONPATH=os.pathsep) == VALID

    def test_of_what_is_installed_elsewhere_count(self, checkout, tmp_path):
        site = tmp_path / "site"
        pretend_to_be_installed(site)
        shutil.move(checkout.write_leaves(), site)
        assert checkout.validate(PYTHONPATH=str(site)) == VALID

    def test_of_a_workspace_that_was_sourced_count_wherever_it_lies(self, checkout):
        checkout.write_leaves("install/lib/gripper.py")
        pretend_to_be_installed(checkout.folder / "install" / "lib")
        prefix = checkout.folder / "install"
        assert checkout.validate(PYTHONPATH=str(prefix / "lib"), AMENT_PREFIX_PATH=str(prefix)) == VALID

    def test_of_the_user_s_own_checkout_installed_to_be_edited_count(self, checkout, tmp_path):
        """As `pip install -e .` leaves it: the metadata elsewhere, the code in the checkout."""
        site = tmp_path / "site"
        metadata = pretend_to_be_installed(site)
        (metadata / "direct_url.json").write_text(
            f'{{"url": "{checkout.folder.as_uri()}", "dir_info": {{"editable": true}}}}', encoding="utf-8"
        )
        checkout.write_leaves("src/gripper.py")
        path = os.pathsep.join([str(checkout.folder / "src"), str(site)])
        assert checkout.validate(PYTHONPATH=path) == VALID

    def test_import_what_is_installed_and_not_its_namesake_in_the_checkout(self, checkout, tmp_path):
        site = tmp_path / "site"
        pretend_to_be_installed(site)
        leaves = checkout.write_leaves()
        (site / "gripper.py").write_text(leaves.read_text("utf-8").replace("it has run", "the installed one"))
        path = os.pathsep.join(["", str(site)])
        assert checkout.validate(PYTHONPATH=path) == VALID
        assert checkout.proof.read_text("utf-8") == "the installed one"

    @pytest.mark.parametrize("text", ["not JSON", "[]", '{"url": "file:///"}'])
    def test_of_what_says_strange_things_of_its_origin_count_all_the_same(self, checkout, tmp_path, text):
        site = tmp_path / "site"
        (pretend_to_be_installed(site) / "direct_url.json").write_text(text, encoding="utf-8")
        shutil.move(checkout.write_leaves(), site)
        assert checkout.validate(PYTHONPATH=str(site)) == VALID


class TestWhatAConfigurationReaches:
    def test_a_palette_that_is_linked_from_outside_is_not_read(self, checkout, tmp_path):
        secret = tmp_path / "secret.xml"
        secret.write_text("<secret/>", encoding="utf-8")
        (checkout.folder / "nodes.xml").symlink_to(secret)
        checkout.configure('models = ["nodes.xml"]\n')
        said = checkout.validate()
        assert "error[setting-outside]: models: 'nodes.xml' is outside" in said
        assert "<secret" not in said

    @pytest.mark.parametrize("command", ["validate", "simulate", "show"])
    @pytest.mark.parametrize(
        ("palette", "said"),
        [
            ("nav2:jazy", "there is no palette 'nav2:jazy', did you mean 'nav2:jazzy'?"),
            ("griper:1", "there is no palette 'griper:1' (installed: nav2:"),
            ("nodes.xml", "cannot read"),
        ],
    )
    def test_a_palette_that_is_not_there_is_told_where_it_is_named(self, checkout, command, palette, said):
        checkout.configure(f'models = [\n  "{palette}",\n]\n')
        done = checkout.command(command, "tree.xml")
        assert done.returncode != 0
        assert f"sar.toml:2:4: error[setting-not-found]: {said}" in done.stdout + done.stderr

    def test_without_a_repository_it_reaches_its_own_folder(self, checkout):
        (checkout.folder / ".git").rmdir()
        (checkout.folder.parent / "shared").mkdir()
        checkout.configure('include-path = ["../shared"]\n')
        assert "error[setting-outside]: include-path: '../shared'" in checkout.validate()

    def test_options_reach_further(self, checkout, tmp_path):
        palette = tmp_path / "nodes.xml"
        palette.write_text(
            '<root><TreeNodesModel><Action ID="Grip"/></TreeNodesModel></root>', encoding="utf-8"
        )
        assert checkout.validate("--model", str(palette)) == VALID


@pytest.mark.skipif(sys.platform == "win32" or os.geteuid() != 0, reason="only root gives files away")
class TestAForeignConfiguration:
    def test_is_passed_over_with_a_note(self, checkout):
        os.chown(checkout.configure("not even TOML"), 1234, 1234)
        checkout.write("tree.xml", document("<NavigateToBase/>"))
        done = checkout.command("validate", "tree.xml")
        assert done.stdout == VALID
        assert done.stderr == (
            f"note: {checkout.folder / 'sar.toml'} is ignored, because this file belongs neither to you nor to the owner of "
            "tree.xml\n"
        )

    def test_counts_for_a_tree_of_the_same_owner(self, checkout):
        for path in (checkout.configure("x = 1\n"), checkout.folder / "tree.xml"):
            os.chown(path, 1234, 1234)
        assert "unknown-key" in checkout.validate()

    def test_lets_the_next_one_above_it_count(self, checkout):
        checkout.configure("x = 1\n")
        checkout.write("trees/tree.xml", document("<NavigateToBase/>"))
        os.chown(checkout.write("trees/pyproject.toml", "[tool.sar]\ny = 1\n"), 1234, 1234)
        done = checkout.command("validate", "trees/tree.xml")
        assert done.stdout.startswith("sar.toml:1:1: error[unknown-key]")
        assert f"{checkout.folder}/trees/pyproject.toml is ignored" in done.stderr

    @pytest.mark.parametrize("owner", [0, 1235])
    def test_does_not_keep_the_user_s_own_and_the_system_s_from_counting(self, checkout, monkeypatch, owner):
        tree = checkout.folder / "tree.xml"
        os.chown(tree, 1234, 1234)
        os.chown(checkout.configure('nodes = ["a"]\n'), owner, owner)
        monkeypatch.setattr(os, "geteuid", lambda: 1235)
        assert configuration_for(tree).nodes == ("a",)


def test_a_folder_that_is_gone_keeps_nobody_from_looking(checkout):
    """The current folder may have been deleted."""
    gone = checkout.folder.parent / "gone"
    gone.mkdir()
    tree = checkout.write("tree.xml", document("<NavigateToBase/>"))
    program = (
        f"import os, sys; os.chdir({str(gone)!r}); os.rmdir({str(gone)!r}); "
        f"from sar_compiler.nodes.installed import entry_points; "
        f"from pathlib import Path; print(len(entry_points('sar_compiler.nodes', Path({str(tree.parent)!r}))))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("1\n", "")
    assert Path(tree).exists()
