# Pepper reaches in a container; results come to the folder runs/ beside where it is started:
#   docker build -t pepper-drake .
#   mkdir -p runs && docker run --rm --user "$(id -u)" -v "$PWD/runs:/runs" pepper-drake
# Debian is named, as the libraries' packages have other names in other releases.
FROM python:3.12-slim-bookworm
RUN apt-get update \
    && apt-get install --yes --no-install-recommends libglib2.0-0 libegl1 libgl1-mesa-dri \
    && rm -rf /var/lib/apt/lists/*
WORKDIR /app
COPY pyproject.toml constraints.txt README.md LICENSE ./
COPY apps apps
COPY pepper_drake pepper_drake
RUN pip install --no-cache-dir --constraint constraints.txt .
WORKDIR /runs
# For who runs it as a user without a home: there matplotlib and numba keep what they computed.
ENV MPLCONFIGDIR=/tmp/matplotlib NUMBA_CACHE_DIR=/tmp/numba
ENTRYPOINT ["pepper-drake"]
CMD ["reach", "--output", "/runs/reach"]
