# The program `isoform` in a small image:
#
#   docker build -t isoform .
#   docker run --rm -v "$PWD:/data" --user "$(id -u):$(id -g)" isoform recover scan.ply
FROM rust:1.95-slim-bookworm AS build
WORKDIR /src
COPY . .
ENV CARGO_PROFILE_RELEASE_STRIP=symbols
RUN cargo build --release --locked -p isoform-cli

FROM debian:bookworm-slim
COPY --from=build /src/target/release/isoform /usr/local/bin/isoform
COPY LICENSE-MIT LICENSE-APACHE /usr/share/doc/isoform/
RUN useradd --create-home --uid 1000 isoform && install -d -o isoform -g isoform /data
USER 1000
WORKDIR /data
ENTRYPOINT ["isoform"]
