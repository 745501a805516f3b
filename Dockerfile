# The daemon in a container: docker run --rm --network host -v /etc/h2nav:/etc/h2nav \
#   -v /var/log/h2nav:/var/log/h2nav --device /dev/ttyAMA0 --group-add dialout h2nav
# The base is pinned by its exact version; who needs the same bytes for ever adds the digest that
# `docker buildx imagetools inspect python:3.13.7-slim-bookworm` shows.
FROM python:3.13.7-slim-bookworm AS build
RUN python -m venv /opt/h2nav
COPY packaging/requirements.lock /src/packaging/requirements.lock
RUN /opt/h2nav/bin/pip install --no-cache-dir --no-compile --only-binary :all: --require-hashes \
    -r /src/packaging/requirements.lock
COPY . /src
# setuptools is in the lock; without isolation nothing else is fetched.
# What the daemon imports is compiled by importing it; the rest of all bytecode is 70 MB.
RUN /opt/h2nav/bin/pip install --no-cache-dir --no-compile --no-deps --no-build-isolation /src \
    && /opt/h2nav/bin/python -c 'import h2nav.apps.daemon'

FROM python:3.13.7-slim-bookworm
RUN useradd --system --groups dialout h2nav && install -d -o h2nav -g h2nav /var/log/h2nav
COPY --from=build /opt/h2nav /opt/h2nav
USER h2nav
ENV PATH=/opt/h2nav/bin:$PATH
ENTRYPOINT ["h2nav"]
CMD ["run", "-c", "/etc/h2nav/config.yaml"]
