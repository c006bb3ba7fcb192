"""Control groups, by which Linux and its containers limit what a process may take."""

from __future__ import annotations

from pathlib import Path


def control_groups(
    controller: str, proc: Path = Path("/proc"), root: Path = Path("/sys/fs/cgroup")
) -> list[Path]:
    """List the folders, which may not exist, of all groups that limit this process.

    That is its own and those above. The controller is "cpu" or "memory"; its files' names tell the
    version of groups, 1 or 2.
    """
    try:
        lines = (proc / "self" / "cgroup").read_text("utf-8", "surrogateescape").splitlines()
    except OSError:
        return []
    groups = []
    for line in lines:
        _, controllers, path = line.split(":", 2)
        if controllers and controller not in controllers.split(","):  # version 2 names none
            continue
        # In version 1, controllers that share a hierarchy are found under both names, or under one.
        for top in {root / controllers, root / controller} if controllers else {root}:
            folder = top / path.lstrip("/")
            groups += [one for one in (folder, *folder.parents) if one.is_relative_to(top)]
    return groups
