// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Waits beside a node until the node's half of the ring needs a starter, then becomes one
// (suite/starter.hpp). It has no library of the suite: nine of them wait in every suite.
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>

namespace {
constexpr int socket_fd = 3;
}

/// srfs-starter SRFS DEPLOYMENT VAR NODE TRUST: SRFS is the program to become
int main(int argc, char** argv) {
  if (argc != 6) {
    (void)std::fprintf(stderr,
                       "srfs-starter: started by the suite beside each node; see lib/suite/README.md\n");
    return 2;
  }
  pollfd entry{socket_fd, POLLIN, 0};
  while (poll(&entry, 1, -1) < 0 && errno == EINTR) {
  }
  if ((entry.revents & POLLIN) == 0) return 0;
  char octet = 0;
  if (recv(socket_fd, &octet, 1, MSG_PEEK) <= 0) return 0;  // the node has ended
  execl(argv[1], argv[1], "--deployment", argv[2], "--var", argv[3], "serve-starter", argv[4], argv[5],
        nullptr);
  std::perror("srfs-starter: cannot become its starter");
  return 1;
}
