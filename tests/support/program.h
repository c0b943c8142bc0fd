// Running a real program in a test: its exit code and everything it prints.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <sys/types.h>

namespace fluorocut::test {

struct Finished {
    int exit_code = -1;  // 128 + signal when a signal ended it
    std::string out;
    std::string err;
};

// A program running beside the test; killed when the object goes before it has finished.
class RunningProgram {
  public:
    // stdin is empty. Throws std::runtime_error when it cannot be started.
    RunningProgram(const std::filesystem::path& program, const std::vector<std::string>& arguments);
    ~RunningProgram();
    RunningProgram(const RunningProgram&) = delete;
    RunningProgram& operator=(const RunningProgram&) = delete;

    void signal(int number) const;
    bool isRunning();
    Finished wait();

  private:
    void noteStatus(int status);

    pid_t process_ = -1;
    bool running_ = false;
    int exit_code_ = -1;
    std::filesystem::path folder_;  // of the files that take its output
};

Finished runProgram(const std::filesystem::path& program, const std::vector<std::string>& arguments);

}  // namespace fluorocut::test
