#!/usr/bin/env python3
"""Runs the Dockerfile's commands without a container engine: each stage in a clean Debian made by debootstrap, as root.

    sudo packaging/container-test.py          # the whole image, then svl in it
    sudo packaging/container-test.py WHEEL    # the last stage, with this wheel in place of the built one

It knows what our Dockerfile uses: FROM, RUN, ENV, WORKDIR, COPY, USER, ENTRYPOINT, CMD.
"""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def instructions(text):
    """Pairs of keyword and argument, without comments and continued lines."""
    lines = "\n".join(line for line in text.splitlines() if not line.startswith("#"))
    for line in lines.replace("\\\n", " ").splitlines():
        if line.strip():
            keyword, argument = line.split(maxsplit=1)
            yield keyword, argument


class Stage:
    def __init__(self, image, folder):
        self.root, self.env, self.workdir, self.user = folder, {"HOME": "/root"}, "/", None
        self.env["PATH"] = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"
        release = re.fullmatch(r"debian:(\w+)-slim@sha256:\w{64}", image)[1]
        subprocess.run(["debootstrap", "--variant=minbase", release, folder], check=True, stdout=subprocess.DEVNULL)
        shutil.copy("/etc/resolv.conf", folder / "etc/resolv.conf")
        # A proxy here may have a certificate that only this machine knows.
        shutil.copy("/etc/ssl/certs/ca-certificates.crt", folder / "etc/here.crt")
        for name in "SSL_CERT_FILE", "CURL_CA_BUNDLE", "CARGO_HTTP_CAINFO", "PIP_CERT":
            self.env[name] = "/etc/here.crt"

    def run(self, *command):
        user = ["--userspec", self.user] if self.user else []
        command = [*user, self.root, "env", "-i", *(f"{k}={v}" for k, v in self.env.items()), *command]
        # /proc is gone with the command.
        mounted = 'mount -t proc proc "$0/proc" && exec chroot "$@"'
        subprocess.run(["unshare", "--mount", "sh", "-c", mounted, self.root, *command], check=True)

    def shell(self, command):
        self.run("sh", "-c", f"cd {shlex.quote(self.workdir)} && {command}")

    def inside(self, path):
        return self.root / os.path.join(self.workdir, path).lstrip("/")


def main():
    wheel = Path(sys.argv[1]) if len(sys.argv) > 1 else None
    with tempfile.TemporaryDirectory() as work:
        stages, stage, skipped = {}, None, False
        entrypoint, command = [], []
        for keyword, argument in instructions((ROOT / "Dockerfile").read_text()):
            print(f"== {keyword} {argument}", flush=True)
            words = argument.split()
            if keyword == "FROM":
                name = words[2] if len(words) > 1 else "last"
                skipped = wheel is not None and name != "last"
                stage = None if skipped else Stage(words[0], Path(work, name))
                stages[name] = stage
            elif skipped:
                continue
            elif keyword == "RUN":
                stage.shell(argument)
            elif keyword == "ENV":
                name, value = argument.split("=", 1)
                stage.env[name] = re.sub(r"\$(\w+)", lambda m: stage.env.get(m[1], ""), value)
            elif keyword == "WORKDIR":
                stage.workdir = argument
                stage.inside(".").mkdir(parents=True, exist_ok=True)
            elif keyword == "COPY" and words[0] == "--from=build" and wheel:
                stage.inside(words[2]).mkdir()
                shutil.copy(wheel, stage.inside(words[2]))
            elif keyword == "COPY" and words[0].startswith("--from="):
                shutil.copytree(stages[words[0].split("=")[1]].inside(words[1]), stage.inside(words[2]))
            elif keyword == "COPY":
                # The committed files are what a clone has.
                files = subprocess.run(["git", "-C", ROOT, "archive", "HEAD"], check=True, stdout=subprocess.PIPE).stdout
                subprocess.run(["tar", "-x", "-C", stage.inside(words[1])], input=files, check=True)
            elif keyword == "USER":
                stage.user = argument
            elif keyword == "ENTRYPOINT":
                entrypoint = json.loads(argument)
            elif keyword == "CMD":
                command = json.loads(argument)
            else:
                sys.exit(f"{keyword}: not known here")
        stage.run(*entrypoint, *command)
        # A mounted folder of the user's.
        stage.run("sh", "-c", "cd /data && svl -q record --frames 12 -o run.mcap && svl -q score run.mcap --algo v3")
        stage.run("sh", "-c", "test -s /data/reports/run/index.html && python3 -c 'import svl_bench'")
        stage.run("sh", "-c", "ffmpeg -version > /dev/null && test $(id -u) = 1000")
        print("== the image is well")


main()
