# The daemon in a container: docker run --rm --network host -v /etc/h2nav:/etc/h2nav \
#   -v /var/log/h2nav:/var/log/h2nav --device /dev/ttyAMA0 h2nav
FROM python:3.13-slim AS build
COPY . /src
RUN python -m venv /opt/h2nav && /opt/h2nav/bin/pip install --no-cache-dir /src

FROM python:3.13-slim
RUN useradd --system --groups dialout h2nav && install -d -o h2nav /var/log/h2nav
COPY --from=build /opt/h2nav /opt/h2nav
USER h2nav
ENV PATH=/opt/h2nav/bin:$PATH
ENTRYPOINT ["h2nav"]
CMD ["run", "-c", "/etc/h2nav/config.yaml"]
