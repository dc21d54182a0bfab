// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Waits beside a node until the node's half of the ring needs a starter, then starts one (suite/starter.hpp),
// and another when that one fails. It has no library of the suite: nine of them wait in every suite.
#include <poll.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>

namespace {

constexpr int socket_fd = 3;
constexpr int longest_end_ms = 10'000;  // of a starter whose node has ended

/// Until there is one. @return false: the node has ended
bool wait_for_request() {
  pollfd entry{socket_fd, POLLIN | POLLRDHUP, 0};
  while (poll(&entry, 1, -1) < 0 && errno == EINTR) {
  }
  return (entry.revents & (POLLRDHUP | POLLHUP | POLLERR)) == 0;
}

/// @return whether it served until the node's end
bool wait_for_starter(pid_t starter) {
  const int ended = static_cast<int>(syscall(SYS_pidfd_open, starter, 0));
  pollfd entries[] = {{ended, POLLIN, 0}, {socket_fd, POLLRDHUP, 0}};
  while (poll(entries, 2, -1) < 0 && errno == EINTR) {
  }
  if (entries[0].revents == 0 && poll(entries, 1, longest_end_ms) == 0) kill(starter, SIGKILL);
  int status = 0;
  while (waitpid(starter, &status, 0) < 0 && errno == EINTR) {
  }
  if (ended >= 0) close(ended);
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

/// Takes what waits, and says that it is not done: one octet.
void refuse_requests() {
  char octet = 0;
  while (recv(socket_fd, &octet, 1, MSG_DONTWAIT) > 0) {
  }
  (void)send(socket_fd, &octet, 1, MSG_DONTWAIT | MSG_NOSIGNAL);
}

}  // namespace

/// srfs-starter SRFS DEPLOYMENT VAR NODE TRUST: SRFS is the program of the starter
int main(int argc, char** argv) {
  if (argc != 6) {
    (void)std::fprintf(stderr,
                       "srfs-starter: started by the suite beside each node; see lib/suite/README.md\n");
    return 2;
  }
  while (wait_for_request()) {
    const pid_t starter = fork();
    if (starter == 0) {
      execl(argv[1], argv[1], "--deployment", argv[2], "--var", argv[3], "serve-starter", argv[4], argv[5],
            nullptr);
      std::perror("srfs-starter: cannot start the node's starter");
      _exit(1);
    }
    if (starter < 0 || !wait_for_starter(starter)) refuse_requests();
  }
  return 0;
}
