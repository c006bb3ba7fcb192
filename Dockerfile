# docker build -t unbend . && docker run --rm -v "$PWD:/work" unbend match cat.off lion.off -o map.npz
FROM python:3.13-slim
COPY . /source
# What is compiled for this processor is kept: the first match need not wait for the compiler.
RUN pip install --no-cache-dir "/source[plot]" && rm -rf /source \
    && unbend demo -o /tmp/demo.png && rm -rf /tmp/* /root/.cache/unbend
WORKDIR /work
ENTRYPOINT ["unbend"]
