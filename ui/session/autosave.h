// Autosave: every committed edit of a Session goes into a case file, in order, on a thread of its own. The GUI thread
// hands over a pointer and goes on; it waits only in the destructor, until what was handed over is on the disk.
//
//     Autosave autosave(session, folder);      // a new case gets a file of its own there with its first edit
//     autosave.goOnIn(path);                   // a case that was opened is gone on with in its own file
//
// saved(n): the first n edits of this session are on the disk and survive kill -9. Undoing is an edit too. When a file
// cannot be written, failed() says why in one sentence and every further edit is tried again.
#pragma once

#include <QObject>
#include <QString>
#include <condition_variable>
#include <deque>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include "ui/session/case_document.h"
#include "ui/session/session.h"

namespace fluorocut::ui {

class Autosave : public QObject {
    Q_OBJECT

  public:
    Autosave(Session& session, std::filesystem::path folder, QObject* parent = nullptr);
    ~Autosave() override;

    // After Session::open(): the case's own file.
    void goOnIn(const std::filesystem::path& file);
    // Goes on in a new file, which is made at once: "Save as".
    void saveAs(const std::filesystem::path& file);

    // The case's file; empty while it has none.
    const std::filesystem::path& file() const { return file_; }
    qint64 pending() const { return handed_ - saved_; }

  signals:
    void saved(qint64 edits);
    void failed(const QString& sentence);

  private:
    struct Task {
        std::filesystem::path file;
        bool fresh = false;  // in place of whatever is there
        Session::State state;
        std::string edit;
        qint64 number = 0;
    };

    void sessionOpened();
    void hand(const QString& edit, bool fresh = false);
    void work();
    Result<void> write(const Task& task);
    std::filesystem::path newFile() const;

    Session& session_;
    std::filesystem::path folder_, file_;
    qint64 handed_ = 0, saved_ = 0;

    // The worker's own.
    std::optional<CaseWriter> writer_;
    std::filesystem::path writers_file_;

    std::mutex mutex_;
    std::condition_variable come_;
    std::deque<Task> tasks_;
    bool leaving_ = false;
    std::thread thread_;
};

}  // namespace fluorocut::ui
