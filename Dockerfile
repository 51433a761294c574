# svl in a container: the program, ffmpeg for videos, and the Python package svl_bench.
#
#   docker build -t svl .
#   docker run --rm --user "$(id -u):$(id -g)" -v "$PWD:/data" svl score bag.mcap
FROM debian:bookworm-slim AS build
RUN apt-get update && apt-get install -y --no-install-recommends \
      build-essential ca-certificates curl git python3-venv
ENV PATH=/root/.cargo/bin:$PATH
RUN curl -fsSo /tmp/rustup-init "https://static.rust-lang.org/rustup/dist/$(uname -m)-unknown-linux-gnu/rustup-init" \
    && chmod +x /tmp/rustup-init && /tmp/rustup-init -y --profile minimal --default-toolchain 1.95
WORKDIR /svl
COPY . .
RUN packaging/wheel.sh /wheels

FROM debian:bookworm-slim
RUN apt-get update && apt-get install -y --no-install-recommends ffmpeg python3-numpy python3-pip \
    && rm -rf /var/lib/apt/lists/*
COPY --from=build /wheels /wheels
RUN pip3 install --no-cache-dir --no-index --break-system-packages /wheels/*.whl && rm -r /wheels
RUN useradd --create-home --uid 1000 svl && mkdir /data && chown svl /data
USER svl
WORKDIR /data
ENTRYPOINT ["svl"]
CMD ["help"]
