# The command `inertia` in an image of its own, with what requirements.lock names; folders of yours under /work.
#   docker build -t inertia-uq .
#   docker run --rm -v "$PWD":/work inertia-uq identify run.mcap --experiment e.toml --out certificate
# For a serial sensor add: --device /dev/ttyUSB0
FROM debian:bookworm-slim AS python
RUN apt-get update \
    && apt-get install --yes --no-install-recommends python3 \
    && rm -rf /var/lib/apt/lists/*

FROM python AS build
RUN apt-get update && apt-get install --yes --no-install-recommends python3-venv
WORKDIR /source
COPY requirements-uv.lock requirements.lock ./
RUN python3 -m venv /opt/uv \
    && /opt/uv/bin/pip install --no-cache-dir --require-hashes -r requirements-uv.lock \
    && python3 -m venv --without-pip /opt/inertia \
    && /opt/uv/bin/uv pip sync --no-cache --compile-bytecode --python /opt/inertia/bin/python --require-hashes requirements.lock
COPY pyproject.toml README.md LICENSE ./
COPY identify identify
COPY rig rig
COPY uq uq
RUN /opt/uv/bin/uv pip install --no-cache --compile-bytecode --python /opt/inertia/bin/python --no-deps --no-build-isolation .

FROM python
COPY --from=build /opt/inertia /opt/inertia
RUN useradd --create-home --uid 1000 experimenter
USER 1000
WORKDIR /work
ENTRYPOINT ["/opt/inertia/bin/inertia"]
CMD ["--help"]
