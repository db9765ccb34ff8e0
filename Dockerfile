# millstream in a container: docs/operations.md says how to give it a serial port. Nothing is compiled, no Node is needed:
# the dashboard is served as it stands in web/.

ARG PYTHON=3.13-slim-bookworm

FROM python:${PYTHON} AS build
ENV PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_NO_CACHE_DIR=1
RUN python -m venv /opt/millstream
WORKDIR /src
COPY pyproject.toml README.md LICENSE ./
COPY protocol protocol
COPY gcode gcode
COPY jobs jobs
COPY sim sim
COPY server server
COPY web web
RUN /opt/millstream/bin/pip install ".[speed]"

FROM python:${PYTHON}
# The group by its number: ports of the host belong to that number, whatever it is called in here. 20 is Debian's dialout;
# compose.yaml says how another host's is added.
RUN useradd --uid 10001 --user-group --groups 20 --no-create-home --home-dir /data --shell /usr/sbin/nologin millstream \
    && install --directory --owner=10001 --group=10001 --mode=0700 /data \
    && install --directory /config
COPY --from=build /opt/millstream /opt/millstream
ENV PATH=/opt/millstream/bin:$PATH \
    PYTHONUNBUFFERED=1 \
    PYTHONDONTWRITEBYTECODE=1 \
    MILLSTREAM_SERVER__HOST=0.0.0.0 \
    MILLSTREAM_SERVER__DATA_DIR=/data
# millstream.toml is read from here, if there is one; variables do as well.
WORKDIR /config
VOLUME /data
EXPOSE 8420
# By its number, so that an orchestrator sees that it is not root; the groups of the user go with it.
USER 10001
HEALTHCHECK --interval=15s --timeout=5s --start-period=60s CMD ["python", "-m", "server.healthcheck"]
ENTRYPOINT ["millstream"]
CMD ["serve"]
