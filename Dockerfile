# The two commands of the README on a bare machine:
#
#     docker build -t observer-workbench .           sets up, and runs the main job
#     docker run --rm observer-workbench             passes the tests
#     docker run --rm observer-workbench make help   or any other target
FROM python:3.11-slim-bookworm
RUN apt-get update && apt-get install --yes --no-install-recommends git make && rm -rf /var/lib/apt/lists/*
WORKDIR /workbench
COPY . .
RUN make simulate
CMD ["make", "test"]
