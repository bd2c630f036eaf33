// SPDX-License-Identifier: Apache-2.0
#include "live/page_server.h"

#include <httplib.h>

#include <condition_variable>
#include <deque>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "blindcorner/forward/error.h"
#include "live/background_thread.h"

namespace blindcorner::live {
namespace {

using namespace std::chrono_literals;

/// Connections that are served at a time: the hub's browsers, and some that ask for pages.
constexpr std::size_t kWorkers = 80;
/// Connections that wait for a free worker. More wait in the kernel, which has its own bound.
constexpr std::size_t kMostWaiting = 16;
/// Seconds after which the server gives up a request that has not come in, or a client that does
/// not read.
constexpr time_t kReadPatience = 2, kWritePatience = 2;
constexpr std::size_t kMostBody = 1024;  ///< bytes; no request of the page has any
constexpr std::size_t kRequestsPerConnection = 100;
constexpr auto kBeat = 1s;  ///< a comment this often in a silent stream shows who is gone

/// What a queue returns for a job: nothing, or in later versions whether it took the job.
using Taken = decltype(std::declval<httplib::TaskQueue&>().enqueue({}));

/// A bounded pool. Only the thread that accepts connections enqueues jobs, waits if it is full, and
/// shuts it down.
class BoundedPool : public httplib::TaskQueue {
 public:
  BoundedPool() {
    for (std::size_t i = 0; i < kWorkers; ++i) threads_.emplace_back([this] { run(); });
  }

  Taken enqueue(std::function<void()> job) override {
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [&] { return jobs_.size() < kMostWaiting; });
      jobs_.push_back(std::move(job));
    }
    changed_.notify_all();
    return static_cast<Taken>(true);
  }
  /// The threads end when no job is left.
  void shutdown() override {
    {
      const std::lock_guard lock(mutex_);
      ending_ = true;
    }
    changed_.notify_all();
    for (std::thread& thread : threads_) thread.join();
  }

 private:
  void run() {
    give_way();
    for (;;) {
      std::function<void()> job;
      {
        std::unique_lock lock(mutex_);
        changed_.wait(lock, [&] { return ending_ || !jobs_.empty(); });
        if (jobs_.empty()) return;
        job = std::move(jobs_.front());
        jobs_.pop_front();
      }
      changed_.notify_all();
      job();
    }
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::function<void()>> jobs_;
  bool ending_ = false;
  std::vector<std::thread> threads_;
};

/// The value of one cookie.
std::string cookie(const std::string& header, const std::string& name) {
  for (std::size_t begin = 0; begin < header.size();) {
    const std::size_t end = std::min(header.find(';', begin), header.size());
    std::string part = header.substr(begin, end - begin);
    part.erase(0, part.find_first_not_of(' '));
    if (part.starts_with(name + "=")) return part.substr(name.size() + 1);
    begin = end + 1;
  }
  return {};
}

const std::pair<const char*, const char*> kHeaders[] = {
    {"Cache-Control", "no-store"},
    {"X-Content-Type-Options", "nosniff"},
    {"X-Frame-Options", "DENY"},
    {"Referrer-Policy", "no-referrer"},
    {"Cross-Origin-Resource-Policy", "same-origin"},
    {"Content-Security-Policy",
     "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; connect-src "
     "'self'; img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"}};

}  // namespace

void ServerOptions::validate() const {
  if (!is_loopback(address) && token.empty()) {
    throw Error("listen", "found " + address + " without a token, which others could read");
  }
  if (port < 0 || port > 65535) {
    throw Error("port", "found " + std::to_string(port) + ", accepted: 0 to 65535");
  }
}

struct PageServer::Impl {
  Impl(const ServerOptions& options, Served what, EventHub& events, Tally& counts)
      : served(std::move(what)), hub(events), tally(counts) {
    options.validate();
    rules = {options.address, options.port, options.token};
    server.new_task_queue = [] { return new BoundedPool; };  // the server deletes it
    server.set_read_timeout(kReadPatience);
    server.set_write_timeout(kWritePatience);
    server.set_keep_alive_timeout(kReadPatience);
    server.set_keep_alive_max_count(kRequestsPerConnection);
    server.set_payload_max_length(kMostBody);
    server.set_tcp_nodelay(true);
    server.set_socket_options([](socket_t socket) {
      const int yes = 1;
      setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    });
    add_handlers();
    rules.port = options.port == 0 ? server.bind_to_any_port(options.address) : options.port;
    const bool bound =
        options.port == 0 ? rules.port > 0 : server.bind_to_port(options.address, options.port);
    if (!bound) {
      throw Error("port",
                  options.address + ":" + std::to_string(options.port) +
                      " could not be had; another program may use it, --port names another");
    }
    thread = std::thread([this] {
      give_way();
      server.listen_after_bind();
    });
    while (!server.is_running()) std::this_thread::sleep_for(1ms);
  }

  ~Impl() {
    hub.close();
    server.stop();
    thread.join();
  }

  std::string cookie_name() const { return "blindcorner_" + std::to_string(rules.port); }

  std::string token_of(const httplib::Request& request) const {
    if (request.has_param("token")) return request.get_param_value("token");
    const std::string header = request.get_header_value("Authorization");
    constexpr std::string_view kBearer = "Bearer ";
    if (header.starts_with(kBearer)) return header.substr(kBearer.size());
    return cookie(request.get_header_value("Cookie"), cookie_name());
  }

  /// Whether a request may go on to its handler.
  httplib::Server::HandlerResponse judge(const httplib::Request& request,
                                         httplib::Response& response) {
    for (const auto& [name, value] : kHeaders) response.set_header(name, value);
    const RequestFacts facts{request.get_header_value("Host"), request.get_header_value("Origin"),
                             request.get_header_value("Sec-Fetch-Site"),
                             request.get_header_value("Sec-Fetch-Mode"), token_of(request)};
    const std::string reason = request.method != "GET" && request.method != "HEAD"
                                   ? "another method"
                                   : refusal(facts, rules);
    if (reason.empty()) return httplib::Server::HandlerResponse::Unhandled;
    tally.note(Count::refused_requests, "a request was refused: " + reason);
    response.status = 403;
    response.set_content("refused: " + reason + "\n", "text/plain");
    return httplib::Server::HandlerResponse::Handled;
  }

  void add_handlers() {
    server.set_pre_routing_handler(
        [this](const auto& request, auto& response) { return judge(request, response); });
    server.Get("/", [this](const httplib::Request&, httplib::Response& response) {
      if (!rules.token.empty()) {
        response.set_header("Set-Cookie", cookie_name() + "=" + rules.token +
                                              "; HttpOnly; SameSite=Strict; Path=/");
      }
      // A provider's bytes go out as they are. If the page were set as content, the library would
      // compress it for each browser that accepts that, which takes seconds while fits use the
      // processors.
      response.set_content_provider(
          served.page.size(), "text/html; charset=utf-8",
          [this](std::size_t at, std::size_t length, httplib::DataSink& sink) {
            return sink.write(served.page.data() + at, length);
          });
    });
    server.Get("/status.json", [this](const httplib::Request&, httplib::Response& response) {
      response.set_content(served.status ? served.status() : "{}", "application/json");
    });
    server.Get("/events", [this](const httplib::Request&, httplib::Response& response) {
      serve_events(response);
    });
  }

  void serve_events(httplib::Response& response) {
    const std::shared_ptr<EventHub::Queue> queue = hub.join();
    if (queue == nullptr && hub.closed()) {  // the program ends, nothing was wrong
      response.status = 503;
      response.set_content("live has ended\n", "text/plain");
      return;
    }
    if (queue == nullptr) {
      tally.note(Count::refused_requests, "a request was refused: too many browsers");
      response.status = 503;
      response.set_content("too many browsers\n", "text/plain");
      return;
    }
    auto first = std::make_shared<std::string>("retry: 1000\n\n");
    if (served.greeting) *first += served.greeting();
    response.set_chunked_content_provider(
        "text/event-stream",
        [queue, first](std::size_t, httplib::DataSink& sink) {
          if (!first->empty()) {
            const std::string text = std::exchange(*first, {});
            return sink.write(text.data(), text.size());
          }
          if (queue->finished()) {
            sink.done();
            return true;
          }
          const auto event = queue->take(kBeat);
          static const std::string kComment = ":\n\n";
          const std::string& text = event ? **event : kComment;
          return sink.write(text.data(), text.size());
        },
        [this, queue](bool) { hub.leave(queue); });
  }

  Served served;
  EventHub& hub;
  Tally& tally;
  AccessRules rules;
  httplib::Server server;
  std::thread thread;
};

PageServer::PageServer(const ServerOptions& options, Served served, EventHub& hub, Tally& tally)
    : impl_(std::make_unique<Impl>(options, std::move(served), hub, tally)) {}
PageServer::~PageServer() = default;

int PageServer::port() const { return impl_->rules.port; }

std::string PageServer::url() const {
  const AccessRules& rules = impl_->rules;
  const bool all = rules.address == "0.0.0.0" || rules.address == "::";
  std::string host = all ? "localhost" : rules.address;
  if (host.find(':') != std::string::npos) host = "[" + host + "]";
  return "http://" + host + ":" + std::to_string(rules.port) + "/" +
         (rules.token.empty() ? "" : "?token=" + rules.token);
}

}  // namespace blindcorner::live
