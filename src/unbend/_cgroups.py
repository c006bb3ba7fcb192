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
        if not controllers:
            version, tops = 2, [root]
        elif controller in controllers.split(","):
            # Controllers that share a hierarchy are found under both names, or under one.
            version, tops = 1, [root / name for name in {controllers, controller}]
        else:
            continue
        for top in tops:
            folder = top / path.lstrip("/")
            groups += [
                (one, version) for one in (folder, *folder.parents) if one.is_relative_to(top)
            ]
    return groups
