# The daemon in a container, for Docker and for BlueOS (docs/companion.md); tools/image.py builds it
# where there is no Docker. The base is named by its day; who needs the same bytes for ever adds the
# digest that `docker buildx imagetools inspect` shows.
FROM docker.io/library/debian:trixie-20260918-slim AS build
RUN apt-get update && apt-get install -y --no-install-recommends \
    gcc libc6-dev python3-dev python3-venv
RUN python3 -m venv /opt/h2nav
COPY packaging/requirements.lock /src/packaging/requirements.lock
RUN /opt/h2nav/bin/pip install --no-cache-dir --no-compile --only-binary :all: --require-hashes \
    -r /src/packaging/requirements.lock
COPY . /src
# setuptools is in the lock; without isolation nothing else is fetched. H2NAV_NATIVE fails the build
# if the kernels were not compiled. What the daemon imports is compiled to bytecode by importing it;
# the rest of all bytecode is 70 MB.
RUN /opt/h2nav/bin/pip install --no-cache-dir --no-compile --no-deps --no-build-isolation /src \
    && /opt/h2nav/bin/pip uninstall --yes --quiet setuptools pip \
    && H2NAV_NATIVE=require /opt/h2nav/bin/h2nav check-config /src/configs/blueos.yaml \
    && /opt/h2nav/bin/python -c 'import h2nav.apps.daemon, h2nav.live.viewer'

FROM docker.io/library/debian:trixie-20260918-slim
RUN apt-get update && apt-get install -y --no-install-recommends python3 \
    && rm -rf /var/lib/apt/lists/* \
    && useradd --system --groups dialout h2nav \
    && install -d -o h2nav -g h2nav /var/log/h2nav
COPY --from=build /opt/h2nav /opt/h2nav
COPY packaging/blueos/start /opt/h2nav/bin/start-on-blueos
USER h2nav
ENV PATH=/opt/h2nav/bin:$PATH
# The page with the metrics, and the Foxglove WebSocket, where the configuration asks for them.
EXPOSE 8080/tcp 8765/tcp
ENTRYPOINT ["h2nav"]
CMD ["run", "-c", "/etc/h2nav/config.yaml"]

ARG VERSION=0.1.0
# Where the source is published; the labels link to it.
ARG SOURCE=""
LABEL org.opencontainers.image.title="h2nav" \
    org.opencontainers.image.description="Independent attitude and motion estimate over MAVLink" \
    org.opencontainers.image.version="$VERSION" \
    org.opencontainers.image.licenses="MIT" \
    org.opencontainers.image.source="$SOURCE"
# What BlueOS reads. The container gets the vehicle's network and two folders, which belong to root
# there, and no capability. The serial port stays with BlueOS's router.
LABEL version="$VERSION" \
    type="tool" \
    requirements="core >= 1.1" \
    tags='["navigation", "attitude", "mavlink", "logging"]' \
    authors='[{"name": "The h2nav developers", "email": ""}]' \
    company='{"name": "h2nav", "about": "A second opinion on the attitude", "email": ""}' \
    readme="$SOURCE/raw/main/README.md" \
    links="{\"source\": \"$SOURCE\"}" \
    permissions='{ \
        "User": "root", \
        "Entrypoint": ["start-on-blueos"], \
        "ExposedPorts": {"8181/tcp": {}, "8765/tcp": {}}, \
        "HostConfig": { \
            "NetworkMode": "host", \
            "Binds": [ \
                "/usr/blueos/extensions/h2nav/config:/etc/h2nav", \
                "/usr/blueos/extensions/h2nav/logs:/var/log/h2nav" \
            ], \
            "CapDrop": ["ALL"], \
            "SecurityOpt": ["no-new-privileges"] \
        } \
    }'
