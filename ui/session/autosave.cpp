#include "ui/session/autosave.h"

#include <QDateTime>
#include <QMetaObject>
#include <utility>

namespace fluorocut::ui {

namespace fs = std::filesystem;

Autosave::Autosave(Session& session, fs::path folder, QObject* parent)
    : QObject(parent), session_(session), folder_(std::move(folder)), thread_([this] { work(); }) {
    connect(&session_, &Session::opened, this, &Autosave::sessionOpened);
    connect(&session_, &Session::committedTo, this, [this] { hand(session_.undoText()); });
}

Autosave::~Autosave() {
    {
        const std::scoped_lock lock(mutex_);
        leaving_ = true;
    }
    come_.notify_one();
    thread_.join();
}

void Autosave::sessionOpened() {
    file_.clear();
}

void Autosave::goOnIn(const fs::path& file) {
    file_ = file;
}

void Autosave::saveAs(const fs::path& file) {
    file_ = file;
    hand(tr("Save as"), true);
}

fs::path Autosave::newFile() const {
    const QString now = QDateTime::currentDateTime().toString("yyyy-MM-dd_HH-mm-ss");
    std::error_code ignored;
    for (int i = 1;; ++i) {
        const QString number = i == 1 ? QString() : QString("_%1").arg(i);
        fs::path file = folder_ / (now + number + ".fluorocut").toStdString();
        if (!fs::exists(file, ignored)) return file;
    }
}

void Autosave::hand(const QString& edit, bool fresh) {
    if (file_.empty()) {
        file_ = newFile();
        fresh = true;
    }
    {
        const std::scoped_lock lock(mutex_);
        tasks_.push_back({file_, fresh, session_.committed(), edit.toStdString(), ++handed_});
    }
    come_.notify_one();
}

void Autosave::work() {
    while (true) {
        Task task;
        {
            std::unique_lock lock(mutex_);
            come_.wait(lock, [this] { return leaving_ || !tasks_.empty(); });
            if (tasks_.empty()) return;
            task = std::move(tasks_.front());
            tasks_.pop_front();
        }
        const Result<void> written = write(task);
        const QString sentence = written ? QString() : QString::fromStdString(written.error().message());
        QMetaObject::invokeMethod(
            this,
            [this, number = task.number, sentence] {
                saved_ = number;
                if (sentence.isEmpty())
                    emit saved(number);
                else
                    emit failed(sentence);
            },
            Qt::QueuedConnection);
    }
}

Result<void> Autosave::write(const Task& task) {
    if (!task.fresh && task.file == writers_file_ && writer_) return writer_->write(*task.state, task.edit);
    writer_.reset();  // and its lock
    writers_file_ = task.file;
    std::error_code failed;
    // Also when an earlier edit could not make it.
    const bool fresh = task.fresh || !fs::exists(task.file, failed);
    if (fresh) {
        const fs::path folder = task.file.parent_path();
        failed.clear();
        if (!folder.empty()) fs::create_directories(folder, failed);
        if (failed) return outputFailed(folder.string(), failed.message(), "choose another folder");
        if (const Result<void> written = writeCase(task.file, *task.state); !written) return written;
    }
    Result<CaseWriter> writer = CaseWriter::append(task.file);
    if (!writer) return writer.error();
    writer_.emplace(std::move(*writer));
    return fresh ? Result<void>() : writer_->write(*task.state, task.edit);
}

}  // namespace fluorocut::ui
