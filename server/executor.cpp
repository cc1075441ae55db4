#include "server/executor.h"

#include <utility>

namespace remesh {

Executor::Executor(int threads) {
    for (int i = 0; i < threads; ++i) {
        threads_.emplace_back([this] { run(); });
    }
}

Executor::~Executor() {
    {
        const std::scoped_lock lock(mutex_);
        is_closing_ = true;
    }
    ready_.notify_all();
}

void Executor::post(std::function<void()> task) {
    {
        const std::scoped_lock lock(mutex_);
        tasks_.push_back(std::move(task));
    }
    ready_.notify_one();
}

void Executor::run() {
    while (true) {
        std::function<void()> task;
        {
            std::unique_lock lock(mutex_);
            ready_.wait(lock, [this] { return is_closing_ || !tasks_.empty(); });
            if (tasks_.empty()) {
                return;
            }
            task = std::move(tasks_.front());
            tasks_.pop_front();
        }
        task();
    }
}

}  // namespace remesh
