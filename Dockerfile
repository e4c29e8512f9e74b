# Poise with the CPU build of torch and an off-screen OpenGL: `docker build -t poise .`, then
# `docker run --rm -v "$PWD/out:/poise/out" poise demo`.
FROM python:3.11-slim
RUN apt-get update && apt-get install -y --no-install-recommends gcc libosmesa6 && rm -rf /var/lib/apt/lists/*
WORKDIR /poise
COPY . .
RUN pip install --no-cache-dir --extra-index-url https://download.pytorch.org/whl/cpu -c constraints.txt -e ".[view,motion,export]"
ENV MUJOCO_GL=osmesa
ENTRYPOINT ["poise"]
CMD ["--help"]
