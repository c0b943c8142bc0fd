#include "tests/support/program.h"

#include <cerrno>
#include <csignal>
#include <cstring>
#include <fstream>
#include <iterator>
#include <stdexcept>

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

namespace fluorocut::test {
namespace {

namespace fs = std::filesystem;

std::string content(const fs::path& path) {
    std::ifstream stream(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
}

}  // namespace

RunningProgram::RunningProgram(const fs::path& program, const std::vector<std::string>& arguments) {
    std::string pattern = (fs::temp_directory_path() / "fluorocut-run-XXXXXX").string();
    if (!mkdtemp(pattern.data())) throw std::runtime_error("cannot make a folder for the program's output");
    folder_ = pattern;

    std::vector<std::string> all{program.string()};
    all.insert(all.end(), arguments.begin(), arguments.end());
    std::vector<char*> argv;
    for (std::string& argument : all)
        argv.push_back(argument.data());
    argv.push_back(nullptr);

    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    const int flags = O_WRONLY | O_CREAT | O_TRUNC;
    posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, (folder_ / "out").c_str(), flags, 0600);
    posix_spawn_file_actions_addopen(&files, STDERR_FILENO, (folder_ / "err").c_str(), flags, 0600);
    const int failed = posix_spawn(&process_, all[0].c_str(), &files, nullptr, argv.data(), environ);
    posix_spawn_file_actions_destroy(&files);
    if (failed != 0) {
        fs::remove_all(folder_);
        throw std::runtime_error("cannot start " + all[0] + ": " + std::strerror(failed));
    }
    running_ = true;
}

RunningProgram::~RunningProgram() {
    if (running_) {
        ::kill(process_, SIGKILL);
        waitpid(process_, nullptr, 0);
    }
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
}

void RunningProgram::signal(int number) const {
    if (running_) ::kill(process_, number);
}

void RunningProgram::noteStatus(int status) {
    running_ = false;
    exit_code_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

bool RunningProgram::isRunning() {
    int status = 0;
    if (running_ && waitpid(process_, &status, WNOHANG) == process_) noteStatus(status);
    return running_;
}

Finished RunningProgram::wait() {
    int status = 0;
    while (running_) {
        if (waitpid(process_, &status, 0) == process_) {
            noteStatus(status);
        } else if (errno != EINTR) {
            throw std::runtime_error("waiting for a program failed");
        }
    }
    return {exit_code_, content(folder_ / "out"), content(folder_ / "err")};
}

Finished runProgram(const fs::path& program, const std::vector<std::string>& arguments) {
    return RunningProgram(program, arguments).wait();
}

}  // namespace fluorocut::test
