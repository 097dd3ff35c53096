"""The workflows run what the Makefile and the pages say, and nothing else, so that neither can go
stale alone.
"""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest
import yaml
from helpers import annexes
from helpers.sources import loaded
from test_architecture import ANNEXES

import smc_mujoco

pytestmark = pytest.mark.quick

ROOT = Path(__file__).parents[1]
ACTION = ROOT / ".github" / "actions" / "enter" / "action.yml"
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
PAGES = ("docs/install.md", "CONTRIBUTING.md", "docs/enter.md")
TARGETS = set(
    re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
)
SHARED = re.compile(r"sudo | --yes")  # what a machine needs that nobody sits at


def commands(page: str) -> set[str]:
    """The commands in a page's blocks of sh, and in its text."""
    text = (ROOT / page).read_text(encoding="utf-8")
    blocks = "\n".join(re.findall(r"^```sh\n(.*?)^```", text, re.MULTILINE | re.DOTALL))
    lines = []
    for line in blocks.splitlines():
        lines.append(line.partition("   #")[0].partition("  #")[0].strip())
    return {
        *lines,
        *re.findall(r"`([^`]+)`", re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)),
    }


KNOWN = set().union(*map(commands, PAGES))


def jobs(workflow: Path) -> dict:
    return yaml.safe_load(workflow.read_text(encoding="utf-8"))["jobs"]


STEPS = [
    (file.name, step) for file in WORKFLOWS for job in jobs(file).values() for step in job["steps"]
]
RUN = [(name, step["run"]) for name, step in STEPS if "run" in step]


def written_out(command: str, workflow: str) -> list[str]:
    """A command for each package of the matrix that it names."""
    if "${{" not in command:
        return [command]
    strategies = []
    for job in jobs(ROOT / ".github/workflows" / workflow).values():
        strategies.append(job.get("strategy", {}))
    package_lists = [strategy["matrix"]["package"] for strategy in strategies if strategy]
    return [
        command.replace("${{ matrix.package }}", package)
        for packages in package_lists
        for package in packages
    ]


def test_a_workflow_s_command_is_one_of_the_makefile_or_of_a_page():
    for workflow, command in RUN:
        if command.startswith("make "):
            assert command.split()[1] in TARGETS, workflow
        else:
            assert {
                SHARED.sub("", plain_command) for plain_command in written_out(command, workflow)
            } <= KNOWN, workflow


def test_what_a_change_must_pass_is_one_list_which_ci_runs_and_the_workflows_share():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    (promised,) = re.findall(r"^promised: (.*?) ##", makefile, re.MULTILINE)
    assert (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()[-1].split()[
        -1
    ] == "promised"
    of_push = []
    for file in WORKFLOWS:
        of_push.append(yaml.safe_load(file.read_text(encoding="utf-8")))
    # YAML 1.1 reads `on` as true
    of_push = [data["jobs"] for data in of_push if "push" in data[True]]
    commands = set()
    for named in of_push:
        for job in named.values():
            for step in job["steps"]:
                if "run" in step:
                    commands.add(step["run"])
    targets = set()
    for command in commands:
        if command.startswith("make "):
            targets.add(command.split()[1])
    assert targets == {*promised.split()}


def test_what_only_slow_tests_hold_runs_once_a_day_and_so_does_the_rest_without_an_annex():
    daily = ROOT / ".github" / "workflows" / "daily.yml"
    commands = set()
    for job in jobs(daily).values():
        commands.add(job["steps"][-1]["run"])
    targets = "slow", "without", "cardless", "lowest", "sanitized", "snippets"
    assert commands == {f"make {target}" for target in targets}
    rooms = sorted(ANNEXES)
    assert jobs(daily)["without"]["strategy"]["matrix"]["annex"] == [*rooms, " ".join(rooms)]
    for annex in annexes.HERE:
        assert (ROOT / "smc_mujoco" / annex).is_dir()
        assert (ROOT / "tests" / annex).is_dir()


def test_compiled_code_is_kept_from_one_job_to_the_next_where_its_path_is():
    for _, step in STEPS:
        if "actions/cache@" in step.get("uses", ""):
            assert step["with"]["path"] == "~/.cache/smc_mujoco/numba"
    text = (ROOT / ".github" / "workflows" / "weekly.yml").read_text(encoding="utf-8")
    assert "actions/cache" not in text


@pytest.mark.parametrize("workflow", WORKFLOWS, ids=lambda path: path.name)
def test_a_workflow_may_read_and_no_more(workflow):
    data = yaml.safe_load(workflow.read_text(encoding="utf-8"))
    assert data["permissions"] == {"contents": "read"}
    for job in data["jobs"].values():
        assert {*job.get("permissions", {})} <= {"pages", "id-token", "attestations"}
        for step in job["steps"]:
            if step.get("uses", "").startswith("actions/checkout"):
                assert step["with"]["persist-credentials"] is False


@pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")
def test_a_release_has_the_tag_of_its_version():
    for tag, code in (
        (f"v{smc_mujoco.__version__}", 0),
        (smc_mujoco.__version__, 2),
        ("v9", 2),
        ("v0' || true '", 2),
    ):
        environment = os.environ | {"TAG": tag}
        done = subprocess.run(
            ["make", "tagged"],
            check=False,
            cwd=ROOT,
            env=environment,
            capture_output=True,
            text=True,
        )
        assert done.returncode == code
        assert (f"the tag is '{tag}'" in done.stderr) == (code != 0)


def test_a_stranger_s_code_meets_no_secret():
    """A workflow for pull requests has none, and none runs with the rights of the repository."""
    for workflow in WORKFLOWS:
        text = workflow.read_text(encoding="utf-8")
        events = yaml.safe_load(text)[True]  # YAML 1.1 reads `on` as true
        assert not {"pull_request_target", "workflow_run"} & {*events}
        assert "pull_request" not in events or "secrets." not in text


ENTERED = loaded(ROOT / ".github" / "entered.py")
GIT = ["git", "-c", "user.name=a", "-c", "user.email=a@b", "-c", "init.defaultBranch=main"]


def commit(folder, *paths):
    for path in paths:
        file = folder / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text("changed", encoding="utf-8")
    for command in (["add", "-A"], ["commit", "-q", "--allow-empty", "-m", "a"]):
        subprocess.run([*GIT, *command], cwd=folder, check=True)


@pytest.mark.skipif(shutil.which("git") is None, reason="git is not installed")
@pytest.mark.parametrize(
    ("paths", "found"),
    [
        (["entries/soft_relay/law.py", "entries/soft_relay/entry.toml"], "entries/soft_relay"),
        (["entries/one/law.py", "entries/two/law.py"], None),
        (["entries/one/law.py", "smc_mujoco/problems/rules/1.toml"], None),
        (["entries/one; id/law.py"], None),
        ([], None),
    ],
)
def test_a_merge_brings_one_entry_and_nothing_else(paths, found, tmp_path, monkeypatch):
    """Main has moved on since the branch began."""
    monkeypatch.chdir(tmp_path)
    subprocess.run([*GIT, "init", "-q"], check=True)
    commit(tmp_path, "README.md")
    subprocess.run([*GIT, "checkout", "-q", "-b", "entry"], check=True)
    commit(tmp_path, *paths)
    subprocess.run([*GIT, "checkout", "-q", "main"], check=True)
    commit(tmp_path, "entries/of_another/law.py", "docs/index.md")
    subprocess.run([*GIT, "merge", "-q", "--no-ff", "-m", "merge", "entry"], check=True)
    if found:
        assert ENTERED.changed() == found
    else:
        with pytest.raises(SystemExit, match="one folder entries/NAME"):
            ENTERED.changed()


@pytest.mark.parametrize("against", ["", "older results.zip"])
def test_the_action_enters_a_folder_with_the_suite_and_the_results_it_is_given(tmp_path, against):
    """Values come by the environment alone, so that none can be a command."""
    action = yaml.safe_load(ACTION.read_text(encoding="utf-8"))
    *_, step = action["runs"]["steps"]
    assert "${{" not in step["run"]
    inputs = {
        "folder": "my law; echo no",
        "suite": action["inputs"]["suite"]["default"],
        "against": against,
    }
    program = tmp_path / "smc-mujoco"
    program.write_text('#!/bin/sh\nprintf "%s\\n" "$@"\n', encoding="utf-8")
    program.chmod(0o755)
    read = {}
    for name, value in step["env"].items():
        read[name] = inputs[value.removeprefix("${{ inputs.").removesuffix(" }}")]
    environment = {
        **os.environ,
        "PATH": f"{tmp_path}:{os.environ['PATH']}",
        **read,
    }
    out = subprocess.run(
        ["bash", "-c", step["run"]],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    assert out.splitlines() == [
        "enter",
        inputs["folder"],
        "--suite",
        "smc-30@1",
        *["--against", against] * bool(against),
    ]


def test_every_action_of_others_is_pinned_to_a_commit():
    used = [step["uses"] for _, step in STEPS if "uses" in step]
    used += [
        step["uses"]
        for step in yaml.safe_load(ACTION.read_text(encoding="utf-8"))["runs"]["steps"]
        if "uses" in step
    ]
    for action in used:
        assert re.fullmatch(r"[\w./-]+@[0-9a-f]{40}", action) or action.startswith("./")
