# Three stages: the pages, the Python packages, and what runs. Every RUN stays below its WORKDIR, so that
# tools/dockerfile_steps.py can do the same steps in a clean folder where there is no Docker engine.
FROM node:22.21.1-slim AS pages
WORKDIR /app/frontend
COPY frontend/package.json frontend/package-lock.json frontend/.npmrc ./
RUN npm ci --no-audit --no-fund --loglevel=error
COPY frontend ./
RUN npm run --silent build

FROM python:3.11.14-slim AS packages
WORKDIR /app
COPY requirements.lock deploy/s3.lock ./
RUN python -m venv venv
RUN venv/bin/python -m pip install --no-cache-dir --disable-pip-version-check --require-hashes -r requirements.lock -r s3.lock
COPY pyproject.toml LICENSE README.md ./
COPY tools/wheel_hook.py tools/wheel_hook.py
COPY --from=pages /app/frontend/dist frontend/dist
COPY palpebra palpebra
COPY blink_engine blink_engine
COPY experiments experiments
COPY server server
COPY stimuli_builder stimuli_builder
COPY table_files table_files
COPY video_conversion video_conversion
COPY analysis analysis
COPY migrations migrations
RUN PALPEBRA_WHEEL_WITHOUT=docs,demo,https venv/bin/python -m pip install --no-cache-dir --disable-pip-version-check --no-deps .
RUN mkdir data backups

FROM python:3.11.14-slim
WORKDIR /app
ENV PYTHONDONTWRITEBYTECODE=1 PYTHONUNBUFFERED=1 PATH=/app/venv/bin:$PATH
ENV PALPEBRA_DATA_FOLDER=/app/data PALPEBRA_LOG_FORMAT=json
COPY --from=packages /app/venv venv
COPY deploy/backup.sh ./
# Named volumes take over the owner of the folder they are mounted on.
COPY --from=packages --chown=10001:10001 /app/data data
COPY --from=packages --chown=10001:10001 /app/backups backups
USER 10001:10001
EXPOSE 8000
STOPSIGNAL SIGTERM
HEALTHCHECK --interval=10s --timeout=5s --start-period=60s --retries=6 CMD ["python", "-c", "import urllib.request as r; r.urlopen('http://127.0.0.1:8000/readyz', timeout=4)"]
ENTRYPOINT ["python", "-m", "server"]
CMD ["run", "--host", "0.0.0.0", "--port", "8000", "--workers", "2"]
