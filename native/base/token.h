// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <atomic>
#include <exception>
#include <limits>

namespace bvhlab {

/// Thrown by long calls soon after Token::cancel(); nothing half-made is returned.
struct Cancelled : std::exception {
    const char* what() const noexcept override { return "cancelled"; }
};

/// Progress of one long call, and the wish to stop it. Written by workers, read by any thread.
///
/// Workers call `check()` at least every few milliseconds of work, so that a cancel is honoured
/// within 0.1 s.
class Token {
public:
    Token() = default;
    /// For one part of a longer call: cancelled with `whole`, which must outlive it; progress is
    /// its own.
    explicit Token(const Token* whole) : whole_(whole) {}

    /// Names the stage that begins; `stage` must be a string literal.
    void begin(const char* stage) {
        stage_.store(stage, std::memory_order_relaxed);
        fraction_.store(0.0F, std::memory_order_relaxed);
        cost_.store(no_cost, std::memory_order_relaxed);
    }

    /// Sets the finished share of the stage, in [0, 1].
    void advance(float fraction) { fraction_.store(fraction, std::memory_order_relaxed); }

    /// Sets the cost of the tree as it stands, for stages that improve one (Eq. 2, one reference
    /// per leaf).
    void report_cost(double cost) { cost_.store(cost, std::memory_order_relaxed); }

    void cancel() { cancelled_.store(true, std::memory_order_relaxed); }
    bool cancelled() const {
        return cancelled_.load(std::memory_order_relaxed) || (whole_ && whole_->cancelled());
    }
    float fraction() const { return fraction_.load(std::memory_order_relaxed); }
    double cost() const { return cost_.load(std::memory_order_relaxed); }  ///< NaN where none is
    const char* stage() const { return stage_.load(std::memory_order_relaxed); }

    /// Throws Cancelled once cancel() was called.
    void check() const {
        if (cancelled()) throw Cancelled{};
    }

private:
    static constexpr double no_cost = std::numeric_limits<double>::quiet_NaN();

    const Token* whole_ = nullptr;
    std::atomic<bool> cancelled_{false};
    std::atomic<float> fraction_{0.0F};
    std::atomic<double> cost_{no_cost};
    std::atomic<const char*> stage_{""};
};

}  // namespace bvhlab
