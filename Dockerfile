# svl in a container: the program, ffmpeg for videos, and the Python package svl_bench, of the wheel in the profile `dist`.
# On two cores it takes half an hour. Base image, rustup and crates are pinned by digest, Debian's packages by version.
#
#   docker build -t svl .
#   docker run --rm --user "$(id -u):$(id -g)" -v "$PWD:/data" svl score bag.mcap
FROM debian:bookworm-slim@sha256:96e378d7e6531ac9a15ad505478fcc2e69f371b10f5cdf87857c4b8188404716 AS build
RUN apt-get update && apt-get install -y --no-install-recommends \
      build-essential=12.9 ca-certificates=20230311* curl=7.88.* git=1:2.39.* python3-venv=3.11.*
ENV PATH=/root/.cargo/bin:$PATH
RUN printf '%s\n' \
      '4acc9acc76d5079515b46346a485974457b5a79893cfb01112423c89aeb5aa10  x86_64' \
      '9732d6c5e2a098d3521fca8145d826ae0aaa067ef2385ead08e6feac88fa5792  aarch64' \
      | sed -n "s,$(uname -m)\$,/tmp/rustup-init,p" > /tmp/digest \
    && curl -fsSo /tmp/rustup-init \
      "https://static.rust-lang.org/rustup/archive/1.29.0/$(uname -m)-unknown-linux-gnu/rustup-init" \
    && sha256sum --check /tmp/digest \
    && chmod +x /tmp/rustup-init && /tmp/rustup-init -y --profile minimal --default-toolchain 1.95
WORKDIR /svl
COPY . .
RUN packaging/wheel.sh /wheels dist

FROM debian:bookworm-slim@sha256:96e378d7e6531ac9a15ad505478fcc2e69f371b10f5cdf87857c4b8188404716
RUN apt-get update && apt-get install -y --no-install-recommends \
      ffmpeg=7:5.1.* python3-numpy=1:1.24.* python3-pip=23.0.* \
    && rm -rf /var/lib/apt/lists/*
COPY --from=build /wheels /wheels
RUN pip3 install --no-cache-dir --no-index --break-system-packages /wheels/*.whl && rm -r /wheels
RUN useradd --create-home --uid 1000 svl && mkdir /data && chown svl /data
USER svl
WORKDIR /data
ENTRYPOINT ["svl"]
CMD ["help"]
