"""Build the Blender extension with the wheels that it needs: ``make blender``."""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "blender"
PLATFORMS = {
    "linux-x64": ("manylinux_2_28_x86_64", "manylinux_2_27_x86_64", "manylinux2014_x86_64"),
    "macos-arm64": ("macosx_14_0_arm64", "macosx_12_0_arm64", "macosx_11_0_arm64"),
    "macos-x64": ("macosx_14_0_x86_64", "macosx_10_15_x86_64", "macosx_10_9_x86_64"),
    "windows-x64": ("win_amd64",),
}
# Python of Blender: its NumPy, its first version of Blender, and the first with the next Python.
BLENDERS = {"3.11": ("1.26.4", "4.5.0", "5.1.0"), "3.13": ("2.3.4", "5.1.0", "5.4.0")}


def build(platform: str, python: str, folder: Path) -> Path:
    """Write the extension's zip for one platform and Python into a folder, and return its path."""
    numpy, first, end = BLENDERS[python]
    if platform == "windows-x64" and numpy < "2":
        raise SystemExit("unbend needs NumPy 2 on Windows: build for Blender 5.1, --python 3.13")
    text = (SOURCE / "blender_manifest.toml").read_text("utf-8")
    version = tomllib.loads(text)["version"]
    with tempfile.TemporaryDirectory() as place:
        download(platform, python, numpy, Path(place))
        wheels = sorted(p for p in Path(place).glob("*.whl") if not p.name.startswith("numpy-"))
        text = text.replace("platforms = []", f"platforms = {json.dumps([platform])}")
        names = json.dumps([f"./wheels/{wheel.name}" for wheel in wheels], indent=2)
        text = text.replace("wheels = []", f"wheels = {names}")
        text = text.replace('min = "4.5.0"', f'min = "{first}"')
        text = text.replace('max = "5.1.0"', f'max = "{end}"')
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / f"unbend-{version}-{platform}-python{python}.zip"
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("blender_manifest.toml", text)
            for source in (*SOURCE.glob("*.py"), ROOT / "LICENSE"):
                archive.write(source, source.name)
            for wheel in wheels:
                archive.write(wheel, f"wheels/{wheel.name}", zipfile.ZIP_STORED)
    return path


def download(platform: str, python: str, numpy: str, folder: Path) -> None:
    """Put the wheels of unbend and of all that it needs into a folder."""
    pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*pip, "wheel", "--no-deps", "-w", folder, ROOT], check=True)
    (unbend,) = folder.glob("unbend-*.whl")
    # pip evaluates the conditions of dependencies for this system, not for the other one.
    extra = ["colorama"] if platform == "windows-x64" else []
    tags = [part for tag in PLATFORMS[platform] for part in ("--platform", tag)]
    asked = ["--only-binary=:all:", "--python-version", python, *tags, "-d", folder]
    subprocess.run([*pip, "download", *asked, unbend, f"numpy=={numpy}", *extra], check=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--platform", choices=PLATFORMS, default="linux-x64")
    parser.add_argument("--python", choices=BLENDERS, default="3.11")
    given = parser.parse_args()
    path = build(given.platform, given.python, ROOT / "dist")
    print(f"{path}: {path.stat().st_size / 1e6:.0f} MB")
