# Pepper reaches in a container: docker build -t pepper-drake . && docker run pepper-drake
FROM python:3.12-slim
RUN apt-get update \
    && apt-get install --yes --no-install-recommends libglib2.0-0 libegl1 libgl1-mesa-dri \
    && rm -rf /var/lib/apt/lists/*
WORKDIR /app
COPY pyproject.toml constraints.txt README.md LICENSE ./
COPY apps apps
COPY pepper_drake pepper_drake
RUN pip install --no-cache-dir --constraint constraints.txt .
WORKDIR /runs
ENTRYPOINT ["pepper-drake"]
CMD ["reach", "--output", "/runs/reach"]
