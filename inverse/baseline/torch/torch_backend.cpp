// SPDX-License-Identifier: Apache-2.0
/// The network, implemented with libtorch. This file is a shared library of its own (see
/// cnn_backend.h) and the only file that includes libtorch's headers.
#include <caffe2/serialize/inline_container.h>
#include <torch/csrc/jit/serialization/pickler.h>
#include <torch/torch.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <memory>
#include <numeric>
#include <random>
#include <thread>

#include "blindcorner/forward/error.h"
#include "inverse/baseline/cnn_backend.h"

namespace blindcorner {
namespace {

using torch::Tensor;
/// Contents of a file: tensors and one text, by name.
using Entries = c10::Dict<c10::IValue, c10::IValue>;

constexpr const char* kMetadata = "metadata";

/// A network to train and the loss of its outputs.
class Network : public torch::nn::Module {
 public:
  /// Maps `histograms` [batch, zones, bins] and `sensors` [batch, 3] to [batch, outputs]. `random`
  /// chooses half of the second convolution's values to drop; null: none are dropped.
  virtual Tensor forward(const Tensor& histograms, const Tensor& sensors,
                         std::mt19937_64* random) = 0;
  /// Mean loss over the batch and the `targets` [batch, outputs].
  virtual Tensor loss(const Tensor& outputs, const Tensor& targets) const = 0;
};

/// A mask of zeros and twos, equally likely. One random word makes 64 of them: libtorch's own
/// dropout takes a quarter of a training step.
Tensor dropout_mask(at::IntArrayRef sizes, std::mt19937_64& random) {
  Tensor mask = torch::empty(sizes);
  auto* values = mask.data_ptr<float>();
  const std::int64_t count = mask.numel();
  for (std::int64_t i = 0; i < count; i += 64) {
    const std::uint64_t word = random();
    const std::int64_t end = std::min<std::int64_t>(64, count - i);
    for (std::int64_t bit = 0; bit < end; ++bit) {
      values[i + bit] = static_cast<float>(2 * ((word >> bit) & 1));
    }
  }
  return mask;
}

/// Computes the layer as a convolution of one step. oneDNN computes it faster than BLAS computes
/// the product.
Tensor dense(torch::nn::Linear& layer, const Tensor& x) {
  return torch::conv1d(x.unsqueeze(2), layer->weight.unsqueeze(2), layer->bias).squeeze(2);
}

/// Names and shapes are those of the same network in PyTorch:
///   conv1 = Conv1d(zones, 4, 3); norm1 = BatchNorm1d(4); conv2 = Conv1d(4, 8, 3);
///   norm2 = BatchNorm1d(8); hidden = Linear(8 * (bins - 4) + 3, 16); output = Linear(16, outputs)
class PublishedNetwork : public Network {
 public:
  explicit PublishedNetwork(const CnnShape& shape)
      : conv1(register_module("conv1",
                              torch::nn::Conv1d(torch::nn::Conv1dOptions(shape.zones, 4, 3)))),
        norm1(register_module("norm1", torch::nn::BatchNorm1d(4))),
        conv2(register_module("conv2", torch::nn::Conv1d(torch::nn::Conv1dOptions(4, 8, 3)))),
        norm2(register_module("norm2", torch::nn::BatchNorm1d(8))),
        hidden(register_module("hidden", torch::nn::Linear(8 * (shape.bins - 4) + 3, 16))),
        output(register_module("output", torch::nn::Linear(16, shape.outputs))) {}

  Tensor forward(const Tensor& histograms, const Tensor& sensors,
                 std::mt19937_64* random) override {
    Tensor x = torch::relu(norm1->forward(conv1->forward(histograms)));
    x = norm2->forward(conv2->forward(x));
    if (random != nullptr) x = x * dropout_mask(x.sizes(), *random);
    x = torch::cat({torch::relu(x).flatten(1), sensors}, 1);
    return output->forward(torch::relu(dense(hidden, x)));
  }

  Tensor loss(const Tensor& outputs, const Tensor& targets) const override {
    return torch::mse_loss(outputs, targets);
  }

 private:
  torch::nn::Conv1d conv1;
  torch::nn::BatchNorm1d norm1;
  torch::nn::Conv1d conv2;
  torch::nn::BatchNorm1d norm2;
  torch::nn::Linear hidden;
  torch::nn::Linear output;
};

/// One network of the ensemble. Its outputs are a mean and the logarithm of a variance for each
/// target. Its widths are by judgement, four to eight times the published network's.
class WideNetwork : public Network {
 public:
  explicit WideNetwork(const CnnShape& shape)
      : conv1(register_module(
            "conv1", torch::nn::Conv1d(torch::nn::Conv1dOptions(shape.zones, 32, 5).stride(2)))),
        norm1(register_module("norm1", torch::nn::BatchNorm1d(32))),
        conv2(register_module("conv2",
                              torch::nn::Conv1d(torch::nn::Conv1dOptions(32, 48, 5).stride(2)))),
        norm2(register_module("norm2", torch::nn::BatchNorm1d(48))),
        hidden(register_module("hidden", torch::nn::Linear(48 * steps(shape.bins) + 3, 64))),
        output(register_module("output", torch::nn::Linear(64, 2 * shape.outputs))) {}

  /// Without dropout: variances learnt with dropout state errors that are absent when it is off.
  Tensor forward(const Tensor& histograms, const Tensor& sensors,
                 std::mt19937_64* /*random*/) override {
    Tensor x = torch::relu(norm1->forward(conv1->forward(histograms)));
    x = norm2->forward(conv2->forward(x));
    x = torch::cat({torch::relu(x).flatten(1), sensors}, 1);
    x = output->forward(torch::relu(dense(hidden, x)));
    const std::int64_t half = x.size(1) / 2;
    // Standard deviations from a thousandth to seven times half of a range.
    constexpr double kMinLogVariance = -14, kMaxLogVariance = 4;
    const Tensor spread = x.narrow(1, half, half).clamp(kMinLogVariance, kMaxLogVariance);
    return torch::cat({x.narrow(1, 0, half), spread}, 1);
  }

  /// Negative logarithm of the Gaussian likelihood, without its constant.
  Tensor loss(const Tensor& outputs, const Tensor& targets) const override {
    const std::int64_t half = targets.size(1);
    const Tensor log_variance = outputs.narrow(1, half, half);
    const Tensor squares = (outputs.narrow(1, 0, half) - targets).square();
    return 0.5 * (log_variance + squares * torch::exp(-log_variance)).mean();
  }

 private:
  /// Number of steps after two convolutions of five bins in steps of two.
  static std::int64_t steps(std::int64_t bins) { return ((bins - 5) / 2 + 1 - 5) / 2 + 1; }

  torch::nn::Conv1d conv1;
  torch::nn::BatchNorm1d norm1;
  torch::nn::Conv1d conv2;
  torch::nn::BatchNorm1d norm2;
  torch::nn::Linear hidden;
  torch::nn::Linear output;
};

int members_of(const CnnShape& shape) {
  return shape.network == CnnArchitecture::wide ? kWideMembers : 1;
}

/// Prefix of a member's weights in files. The published network has no members and no prefix.
std::string prefix_of(const CnnShape& shape, int member) {
  return shape.network == CnnArchitecture::wide ? "member" + std::to_string(member) + "." : "";
}

std::unique_ptr<Network> make_network(const CnnShape& shape) {
  if (shape.network == CnnArchitecture::wide) return std::make_unique<WideNetwork>(shape);
  return std::make_unique<PublishedNetwork>(shape);
}

/// Weights and running statistics by PyTorch's names.
std::vector<std::pair<std::string, Tensor>> state_of(const Network& network) {
  std::vector<std::pair<std::string, Tensor>> state;
  for (const auto& item : network.named_parameters()) state.emplace_back(item.key(), item.value());
  for (const auto& item : network.named_buffers()) state.emplace_back(item.key(), item.value());
  return state;
}

/// Adds entries in a fixed order, as copies. A view would be stored with its whole storage.
void add_state(const std::vector<std::pair<std::string, Tensor>>& state, const std::string& prefix,
               Entries& entries) {
  for (const auto& [name, tensor] : state) {
    entries.insert(prefix + name, tensor.detach().clone());
  }
}

Entries entries_with(const std::string& metadata) {
  Entries entries(c10::AnyType::get(), c10::AnyType::get());
  entries.insert(std::string(kMetadata), metadata);
  return entries;
}

/// Bytes as torch::pickle_save makes them, without the tag that libtorch puts on a dict. torch.load
/// takes this tag for a call of code and refuses it unless told not to.
std::string pickled(const Entries& entries) {
  std::string pickle;
  torch::jit::Pickler pickler(
      [&](const char* data, std::size_t size) { pickle.append(data, size); }, nullptr, nullptr,
      nullptr, nullptr, /*tag_aggregates=*/false);
  pickler.protocol();
  pickler.pushIValue(c10::IValue(entries));
  pickler.stop();
  std::string bytes;
  caffe2::serialize::PyTorchStreamWriter archive([&](const void* data, std::size_t size) {
    bytes.append(static_cast<const char*>(data), size);
    return size;
  });
  archive.writeRecord("data.pkl", pickle.data(), pickle.size());
  std::size_t number = 0;
  for (const Tensor& tensor : pickler.tensorData()) {
    const auto values = torch::jit::getWriteableTensorData(tensor);
    archive.writeRecord("data/" + std::to_string(number++), values.data(), values.sizeInBytes());
  }
  archive.writeEndOfFile();
  return bytes;
}

Entries unpickled(const std::string& bytes, const std::string& where) {
  const char* const kAccepted =
      "is damaged, truncated or no file of weights; accepted: what cnn train or PyTorch's "
      "torch.save wrote, a dict of tensors and the text 'metadata'";
  // The archive's reader accepts a file whose end is cut off. A complete zip archive ends with this
  // record (end of central directory, without a comment).
  constexpr std::size_t kEndRecord = 22;
  if (bytes.size() < kEndRecord || bytes.compare(bytes.size() - kEndRecord, 4, "PK\x05\x06") != 0) {
    throw Error(where, kAccepted);
  }
  try {
    const c10::IValue value = torch::pickle_load({bytes.begin(), bytes.end()});
    if (value.isGenericDict()) return value.toGenericDict();
  } catch (const std::exception&) {
    // libtorch's own message is a page of its call stack.
  }
  throw Error(where, kAccepted);
}

std::string shape_text(at::IntArrayRef sizes) {
  std::string text;
  for (const std::int64_t size : sizes) text += (text.empty() ? "" : " x ") + std::to_string(size);
  return text.empty() ? "a number" : text;
}

/// The tensor of a name. Throws Error unless it exists in the wanted type and shape and is finite.
Tensor tensor_of(const Entries& entries, const std::string& name, const Tensor& like,
                 const std::string& where) {
  const auto entry = entries.find(name);
  if (entry == entries.end() || !entry->value().isTensor()) {
    throw Error(where + ": " + name, "is missing, accepted: a tensor of " +
                                         shape_text(like.sizes()) +
                                         " (weights of another network?)");
  }
  const Tensor tensor = entry->value().toTensor();
  if (tensor.sizes() != like.sizes() || tensor.scalar_type() != like.scalar_type()) {
    throw Error(where + ": " + name, "found " + shape_text(tensor.sizes()) + " of type " +
                                         c10::toString(tensor.scalar_type()) +
                                         ", accepted: " + shape_text(like.sizes()) + " of type " +
                                         c10::toString(like.scalar_type()));
  }
  if (tensor.is_floating_point() && !torch::isfinite(tensor).all().item<bool>()) {
    throw Error(where + ": " + name, "found values that are not finite, accepted: finite weights");
  }
  return tensor;
}

void load_state(const Entries& entries, const std::string& prefix, Network& network,
                const std::string& where) {
  const torch::NoGradGuard no_gradient;
  for (auto& [name, tensor] : state_of(network)) {
    tensor.copy_(tensor_of(entries, prefix + name, tensor, where));
  }
}

Tensor tensor_view(const std::vector<float>& values, std::vector<std::int64_t> sizes) {
  // libtorch takes no pointer to const; no code writes through this one.
  return torch::from_blob(const_cast<float*>(values.data()), sizes);
}

struct DataTensors {
  DataTensors(const CnnData& data, const CnnShape& shape) {
    const auto count = static_cast<std::int64_t>(data.count());
    histograms = tensor_view(data.histograms, {count, shape.zones, shape.bins});
    sensors = tensor_view(data.sensors, {count, 3});
    if (!data.targets.empty()) targets = tensor_view(data.targets, {count, shape.outputs});
  }
  Tensor histograms, sensors, targets;
};

/// Uses one thread. Steps are too small to share, and sums must not depend on the thread count.
void use_one_thread() { at::set_num_threads(1); }

class TorchNetwork : public CnnNetwork {
 public:
  TorchNetwork(const CnnShape& shape, const Entries& entries, const std::string& where)
      : shape_(shape) {
    for (int member = 0; member < members_of(shape); ++member) {
      members_.push_back(make_network(shape));
      load_state(entries, prefix_of(shape, member), *members_.back(), where);
      members_.back()->eval();
    }
  }

  std::vector<float> evaluate(const CnnData& data) const override {
    use_one_thread();
    const torch::InferenceMode inference;
    const DataTensors tensors(data, shape_);
    std::vector<float> values;
    for (const auto& member : members_) {
      // Evaluation changes nothing in the network; its `forward` also serves training.
      const Tensor outputs =
          member->forward(tensors.histograms, tensors.sensors, nullptr).contiguous();
      const auto* first = outputs.data_ptr<float>();
      values.insert(values.end(), first, first + outputs.numel());
    }
    return values;
  }

  std::string bytes(const std::string& metadata) const override {
    Entries entries = entries_with(metadata);
    for (std::size_t i = 0; i < members_.size(); ++i) {
      add_state(state_of(*members_[i]), prefix_of(shape_, static_cast<int>(i)), entries);
    }
    return pickled(entries);
  }

 private:
  CnnShape shape_;
  std::vector<std::unique_ptr<Network>> members_;
};

/// Adam (Kingma and Ba 2015) with PyTorch's defaults, over all weights in one array. Done parameter
/// by parameter, its many small operations take a fifth of a training step.
class FlatAdam {
 public:
  FlatAdam(torch::nn::Module& network, double learning_rate) : learning_rate_(learning_rate) {
    const std::vector<Tensor> parameters = network.parameters();
    std::int64_t count = 0;
    for (const Tensor& parameter : parameters) count += parameter.numel();
    values_ = torch::zeros({count});
    gradients_ = torch::zeros({count});
    first_ = torch::zeros({count});
    second_ = torch::zeros({count});
    const torch::NoGradGuard no_gradient;
    std::int64_t start = 0;
    for (Tensor parameter : parameters) {
      const Tensor view = values_.narrow(0, start, parameter.numel()).view(parameter.sizes());
      view.copy_(parameter);
      parameter.set_data(view);
      parameter.mutable_grad() =
          gradients_.narrow(0, start, parameter.numel()).view(parameter.sizes());
      start += parameter.numel();
    }
  }

  void zero_gradients() { gradients_.zero_(); }

  void step() {
    // Adam's own constants (Kingma and Ba 2015).
    constexpr double kBeta1 = 0.9, kBeta2 = 0.999, kEpsilon = 1e-8;
    const torch::NoGradGuard no_gradient;
    ++steps_;
    first_.mul_(kBeta1).add_(gradients_, 1 - kBeta1);
    second_.mul_(kBeta2).addcmul_(gradients_, gradients_, 1 - kBeta2);
    const double bias1 = 1 - std::pow(kBeta1, steps_);
    const double bias2 = 1 - std::pow(kBeta2, steps_);
    const Tensor scale = second_.sqrt().div_(std::sqrt(bias2)).add_(kEpsilon);
    values_.addcdiv_(first_, scale, -learning_rate_ / bias1);
  }

  std::vector<std::pair<std::string, Tensor>> state() const {
    return {
        {"adam.first", first_}, {"adam.second", second_}, {"adam.steps", torch::tensor(steps_)}};
  }

  void load(const Entries& entries, const std::string& prefix, const std::string& where) {
    const torch::NoGradGuard no_gradient;
    first_.copy_(tensor_of(entries, prefix + "adam.first", first_, where));
    second_.copy_(tensor_of(entries, prefix + "adam.second", second_, where));
    steps_ = tensor_of(entries, prefix + "adam.steps", torch::tensor(steps_), where)
                 .item<std::int64_t>();
  }

 private:
  double learning_rate_;
  Tensor values_, gradients_, first_, second_;  // [weights]
  std::int64_t steps_ = 0;
};

/// The training of one network: the published one, or a member of the ensemble.
class MemberTrainer {
 public:
  /// `prefix` names the member in files. `data` must outlive this.
  MemberTrainer(const CnnShape& shape, const DataTensors& data, std::int64_t training,
                const CnnTrainingOptions& options, std::string prefix)
      : data_(data),
        training_(training),
        options_(options),
        prefix_(std::move(prefix)),
        network_((torch::manual_seed(options.seed), make_network(shape))),
        adam_(*network_, options.learning_rate) {}

  void load(const Entries& entries, const std::string& where) {
    load_state(entries, prefix_, *network_, where);
    adam_.load(entries, prefix_, where);
    if (entries.find("best." + prefix_ + "conv1.weight") == entries.end()) return;
    remember();
    for (auto& [name, tensor] : best_) {
      tensor = tensor_of(entries, "best." + prefix_ + name, tensor, where);
    }
  }

  /// Runs epoch `number`. Its random numbers depend only on `number` and the seed.
  CnnEpoch run_epoch(int number) {
    use_one_thread();
    std::seed_seq seeds{static_cast<std::uint32_t>(options_.seed),
                        static_cast<std::uint32_t>(options_.seed >> 32),
                        static_cast<std::uint32_t>(number)};
    std::mt19937_64 random(seeds);
    std::vector<std::int64_t> order(static_cast<std::size_t>(training_));
    std::iota(order.begin(), order.end(), std::int64_t{0});
    std::shuffle(order.begin(), order.end(), random);
    const Tensor shuffled = torch::tensor(order);
    network_->train();
    double sum = 0;
    int steps = 0;
    for (std::int64_t start = 0; start < training_; start += options_.batch, ++steps) {
      const std::int64_t size = std::min<std::int64_t>(options_.batch, training_ - start);
      sum += step(shuffled.narrow(0, start, size), random);
    }
    return {sum / steps, validation_loss()};
  }

  /// Keeps the present weights as the best so far.
  void remember() {
    best_.clear();
    for (const auto& [name, tensor] : state_of(*network_)) {
      best_.emplace_back(name, tensor.detach().clone());
    }
  }

  void add_weights(bool remembered, Entries& entries) const {
    add_state(remembered ? best_ : state_of(*network_), prefix_, entries);
  }

  void add_checkpoint(Entries& entries) const {
    add_state(state_of(*network_), prefix_, entries);
    add_state(best_, "best." + prefix_, entries);
    add_state(adam_.state(), prefix_, entries);
  }

 private:
  double step(const Tensor& chosen, std::mt19937_64& random) {
    adam_.zero_gradients();
    const Tensor outputs = network_->forward(data_.histograms.index_select(0, chosen),
                                             data_.sensors.index_select(0, chosen), &random);
    const Tensor loss = network_->loss(outputs, data_.targets.index_select(0, chosen));
    loss.backward();
    adam_.step();
    return loss.item<double>();
  }

  double validation_loss() {
    const std::int64_t count = data_.targets.size(0) - training_;
    if (count == 0) return std::nan("");
    const torch::NoGradGuard no_gradient;
    network_->eval();
    const auto held_back = [&](const Tensor& all) { return all.narrow(0, training_, count); };
    const Tensor outputs =
        network_->forward(held_back(data_.histograms), held_back(data_.sensors), nullptr);
    return network_->loss(outputs, held_back(data_.targets)).item<double>();
  }

  const DataTensors& data_;
  std::int64_t training_;
  CnnTrainingOptions options_;
  std::string prefix_;
  std::unique_ptr<Network> network_;
  FlatAdam adam_;
  std::vector<std::pair<std::string, Tensor>> best_;
};

class TorchTrainer : public CnnTrainer {
 public:
  TorchTrainer(const CnnShape& shape, const CnnData& data, std::size_t training,
               const CnnTrainingOptions& options)
      : data_(data, shape) {
    for (int member = 0; member < members_of(shape); ++member) {
      CnnTrainingOptions own = options;
      own.seed += kMemberSeeds * static_cast<std::uint64_t>(member);
      members_.push_back(std::make_unique<MemberTrainer>(
          shape, data_, static_cast<std::int64_t>(training), own, prefix_of(shape, member)));
    }
  }

  void load(const Entries& entries, const std::string& where) {
    for (const auto& member : members_) member->load(entries, where);
  }

  /// Trains members in parallel, each with one thread, so that the thread count changes no result.
  CnnEpoch run_epoch(int number) override {
    std::vector<CnnEpoch> epochs(members_.size());
    std::atomic<std::size_t> next{0};
    const auto work = [&] {
      for (std::size_t i = next++; i < members_.size(); i = next++) {
        epochs[i] = members_[i]->run_epoch(number);
      }
    };
    {
      const std::size_t threads =
          std::min<std::size_t>(members_.size(), std::max(1U, std::thread::hardware_concurrency()));
      std::vector<std::jthread> others;
      for (std::size_t i = 1; i < threads; ++i) others.emplace_back(work);
      work();
    }
    CnnEpoch mean;
    for (const CnnEpoch& epoch : epochs) {
      mean.training += epoch.training / static_cast<double>(epochs.size());
      mean.validation += epoch.validation / static_cast<double>(epochs.size());
    }
    return mean;
  }

  void remember() override {
    for (const auto& member : members_) member->remember();
  }

  std::string weights(const std::string& metadata, bool remembered) const override {
    Entries entries = entries_with(metadata);
    for (const auto& member : members_) member->add_weights(remembered, entries);
    return pickled(entries);
  }

  std::string checkpoint(const std::string& metadata) const override {
    Entries entries = entries_with(metadata);
    for (const auto& member : members_) member->add_checkpoint(entries);
    return pickled(entries);
  }

 private:
  /// Seeds of members are this far apart: an odd number without a pattern, 2^64 over the golden
  /// ratio.
  static constexpr std::uint64_t kMemberSeeds = 0x9e3779b97f4a7c15;

  DataTensors data_;
  std::vector<std::unique_ptr<MemberTrainer>> members_;
};

class TorchBackend : public CnnBackend {
 public:
  std::string metadata(const std::string& bytes, const std::string& where) const override {
    const Entries entries = unpickled(bytes, where);
    const auto entry = entries.find(std::string(kMetadata));
    if (entry == entries.end() || !entry->value().isString()) {
      throw Error(where + ": metadata", "is missing, accepted: the text that cnn train writes");
    }
    return entry->value().toStringRef();
  }

  std::unique_ptr<CnnNetwork> network(const std::string& bytes, const CnnShape& shape,
                                      const std::string& where) const override {
    const Entries entries = unpickled(bytes, where);
    // Weights of a network take more than a byte for each zone, bin and output. No memory is
    // allocated for a file that claims more of these than it has bytes.
    const int largest = std::max({shape.zones, shape.bins, shape.outputs});
    if (static_cast<std::size_t>(largest) > bytes.size()) {
      throw Error(where + ": metadata", "zones, bins or unknowns: found " +
                                            std::to_string(largest) +
                                            ", accepted: those of the weights in the file");
    }
    return std::make_unique<TorchNetwork>(shape, entries, where);
  }

  std::unique_ptr<CnnTrainer> trainer(const CnnShape& shape, const CnnData& data,
                                      std::size_t training, const CnnTrainingOptions& options,
                                      const std::string& checkpoint,
                                      const std::string& where) const override {
    use_one_thread();
    auto trainer = std::make_unique<TorchTrainer>(shape, data, training, options);
    if (!checkpoint.empty()) trainer->load(unpickled(checkpoint, where), where);
    return trainer;
  }
};

}  // namespace
}  // namespace blindcorner

extern "C" __attribute__((visibility("default"))) const blindcorner::CnnBackend*
blindcorner_cnn_backend() {
  static const blindcorner::TorchBackend backend;
  return &backend;
}
