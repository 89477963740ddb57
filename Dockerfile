# The command `inertia` in an image of its own; folders of yours under /work.
#   docker build -t inertia-uq .
#   docker run --rm -v "$PWD":/work inertia-uq identify run.mcap --experiment e.toml --out certificate
# For a serial sensor add: --device /dev/ttyUSB0
FROM python:3.11-slim AS build
WORKDIR /source
COPY requirements-uv.lock requirements.lock pyproject.toml README.md LICENSE MANIFEST.in ./
RUN python -m pip install --no-cache-dir --require-hashes -r requirements-uv.lock
COPY identify identify
COPY rig rig
COPY uq uq
# The package's own dependencies, at the versions of the lock file, without what only tests need.
RUN python -m venv /opt/inertia \
    && uv pip install --no-cache --python /opt/inertia/bin/python --constraint requirements.lock ".[bags,urdf,frames]" \
    && /opt/inertia/bin/python -m compileall -q /opt/inertia/lib

FROM python:3.11-slim
COPY --from=build /opt/inertia /opt/inertia
RUN useradd --create-home --uid 1000 experimenter
USER 1000
WORKDIR /work
ENTRYPOINT ["/opt/inertia/bin/inertia"]
CMD ["--help"]
