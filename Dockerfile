# The main job in a container: docker build -t infoplan . && docker run -v "$PWD/results:/results" infoplan
FROM python:3.13-slim

# Maps, compiled functions and all else that is kept is where any user may write.
ENV XDG_CACHE_HOME=/cache NUMBA_CACHE_DIR=/tmp/numba MPLCONFIGDIR=/tmp/matplotlib PIP_NO_CACHE_DIR=1

WORKDIR /opt/infoplan
COPY constraints.txt pyproject.toml README.md LICENSE ./
COPY conf conf
COPY infoplan infoplan
ARG EXTRAS=survey,geo
RUN python -m pip install --constraint constraints.txt ".[$EXTRAS]"

# Results belong to who runs it: docker run --user "$(id -u):$(id -g)" ...
RUN mkdir -m 777 /results /cache /cache/infoplan
WORKDIR /
VOLUME /results
ENTRYPOINT ["infoplan"]
CMD ["run", "planner=puct", "detector=copod", "rho=0.1"]
