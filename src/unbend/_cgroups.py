"""Control groups, by which Linux and its containers limit what a process may take."""

from __future__ import annotations

from pathlib import Path


def control_groups(
    controller: str, proc: Path = Path("/proc"), root: Path = Path("/sys/fs/cgroup")
) -> list[tuple[Path, int]]:
    """List the groups that this process is in, from its own up: every one of them limits it.

    The controller is "cpu" or "memory". With each folder, which may not exist, comes the version (1
    or 2) that its files' names are of.
    """
    try:
        lines = (proc / "self" / "cgroup").read_text("utf-8", "surrogateescape").splitlines()
    except OSError:
        return []
    groups = []
    for line in lines:
        _, controllers, path = line.split(":", 2)
        version = 1 if controllers else 2
        if version == 1 and controller not in controllers.split(","):
            continue
        # Controllers that share a hierarchy are found under both names, or under one.
        for top in {root / controllers, root / controller} if version == 1 else {root}:
            folder = top / path.lstrip("/")
            above = (one for one in (folder, *folder.parents) if one.is_relative_to(top))
            groups += [(one, version) for one in above]
    return groups
