// From beams to the blocks of the map as a C++ programmer would write it, with PCL's rules for outliers and the thesis's
// for blocks. Reads the beams from the file named: 16 doubles of T_target_sonar by rows, angle and range resolution, the
// number of bins (int32, of which 0 ends a scan) and the strengths (uint8). Prints seconds of CPU for each stage, summed
// over all scans, and how many points and blocks were left at the end.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <numeric>
#include <unordered_map>
#include <vector>

struct Point { float x, y, z, padding, strength, more[3]; };
struct Beam { double pose[16], angle, resolution; std::vector<uint8_t> strengths; };
using Cloud = std::vector<Point>;

const double MIN_RANGE = 0.5, HEIGHT_LIMIT = 100.0, RESOLUTION = 0.5, OTSU_MULTIPLIER = 1.4, DEVIATIONS = 1.0;
const size_t NEIGHBORS = 20, LEAF_POINTS = 16;

static double cpu_seconds() {
  timespec now;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return now.tv_sec + 1e-9 * now.tv_nsec;
}

static Cloud projected(const std::vector<Beam>& beams) {
  Cloud cloud;
  for (const Beam& beam : beams) {
    const double c = std::cos(beam.angle), s = std::sin(beam.angle);
    const double* T = beam.pose;
    const double dx = T[0] * c + T[1] * s, dy = T[4] * c + T[5] * s, dz = T[8] * c + T[9] * s;
    for (size_t bin = 0; bin < beam.strengths.size(); bin++) {
      const double range = (bin + 0.5) * beam.resolution;
      const Point point = {float(dx * range + T[3]), float(dy * range + T[7]), float(dz * range + T[11]), 1.0f,
                           float(beam.strengths[bin]), {0.0f, 0.0f, 0.0f}};
      if (range >= MIN_RANGE && point.z <= HEIGHT_LIMIT) cloud.push_back(point);
    }
  }
  return cloud;
}

static double otsu(const Cloud& cloud) {
  long histogram[256] = {0}, total = 0, below = 0;
  double sum = 0.0, sum_below = 0.0, greatest = -1.0;
  for (const Point& point : cloud) {
    if (point.strength > 0.0f) histogram[std::min(int(point.strength), 255)]++;
  }
  for (int level = 0; level < 256; level++) {
    sum += double(level) * histogram[level];
    total += histogram[level];
  }
  int first = 0, last = 0;
  for (int level = 0; level < 256; level++) {
    below += histogram[level];
    sum_below += double(level) * histogram[level];
    const long above = total - below;
    if (below == 0 || above == 0) continue;
    const double difference = sum_below / below - (sum - sum_below) / above;
    const double between = double(below) * above * difference * difference;
    if (between > greatest) { greatest = between; first = level; }
    if (between >= greatest) last = level;
  }
  return (first + last) / 2.0;
}

static Cloud thresholded(const Cloud& cloud) {
  const double threshold = OTSU_MULTIPLIER * otsu(cloud);
  Cloud strong;
  for (const Point& point : cloud) {
    if (point.strength > threshold) strong.push_back(point);
  }
  return strong;
}

// A k-d tree as FLANN's: split where a point is in the middle along the widest axis, few points in each leaf.
class Tree {
 public:
  explicit Tree(const Cloud& points) : points_(points), order_(points.size()) {
    std::iota(order_.begin(), order_.end(), 0);
    if (!points.empty()) build(0, points.size());
  }

  double mean_distance(size_t index, size_t neighbors) const {
    std::vector<double> nearest;
    search(0, index, neighbors, nearest);
    double sum = 0.0;
    for (double square : nearest) sum += std::sqrt(square);
    return sum / nearest.size();
  }

 private:
  struct Node { size_t start, end, near, far; int axis; float value; };

  static float along(const Point& point, int axis) { return axis == 0 ? point.x : axis == 1 ? point.y : point.z; }

  size_t build(size_t start, size_t end) {
    const size_t number = nodes_.size();
    nodes_.push_back({start, end, 0, 0, -1, 0.0f});
    if (end - start <= LEAF_POINTS) return number;
    int axis = 0;
    float widest = -1.0f;
    for (int candidate = 0; candidate < 3; candidate++) {
      const auto less = [&](size_t a, size_t b) { return along(points_[a], candidate) < along(points_[b], candidate); };
      const auto ends = std::minmax_element(order_.begin() + start, order_.begin() + end, less);
      const float width = along(points_[*ends.second], candidate) - along(points_[*ends.first], candidate);
      if (width > widest) { widest = width; axis = candidate; }
    }
    const size_t middle = (start + end) / 2;
    std::nth_element(order_.begin() + start, order_.begin() + middle, order_.begin() + end,
                     [&](size_t a, size_t b) { return along(points_[a], axis) < along(points_[b], axis); });
    const float value = along(points_[order_[middle]], axis);
    const size_t near = build(start, middle), far = build(middle, end);
    nodes_[number] = {start, end, near, far, axis, value};
    return number;
  }

  void search(size_t number, size_t self, size_t wanted, std::vector<double>& nearest) const {
    const Node& node = nodes_[number];
    const Point& point = points_[self];
    if (node.axis < 0) {
      for (size_t place = node.start; place < node.end; place++) {
        if (order_[place] == self) continue;
        const Point& other = points_[order_[place]];
        const double dx = double(other.x) - point.x, dy = double(other.y) - point.y, dz = double(other.z) - point.z;
        const double square = dx * dx + dy * dy + dz * dz;
        if (nearest.size() == wanted && square >= nearest.back()) continue;
        if (nearest.size() == wanted) nearest.pop_back();
        nearest.insert(std::upper_bound(nearest.begin(), nearest.end(), square), square);
      }
      return;
    }
    const double distance = double(along(point, node.axis)) - node.value;
    search(distance < 0.0 ? node.near : node.far, self, wanted, nearest);
    if (nearest.size() < wanted || distance * distance < nearest.back()) {
      search(distance < 0.0 ? node.far : node.near, self, wanted, nearest);
    }
  }

  const Cloud& points_;
  std::vector<size_t> order_;
  std::vector<Node> nodes_;
};

static Cloud cleaned(const Cloud& cloud) {
  const size_t number = cloud.size();
  if (number < 3) return cloud;
  const Tree tree(cloud);
  std::vector<double> means(number);
  double sum = 0.0, squares = 0.0;
  for (size_t index = 0; index < number; index++) {
    means[index] = tree.mean_distance(index, std::min(NEIGHBORS, number - 1));
    sum += means[index];
    squares += means[index] * means[index];
  }
  const double limit = sum / number + DEVIATIONS * std::sqrt((squares - sum * sum / number) / (number - 1));
  Cloud kept;
  for (size_t index = 0; index < number; index++) {
    if (means[index] <= limit) kept.push_back(cloud[index]);
  }
  return kept;
}

struct Block {
  double mean[4], squares[4], bottom, top, count;

  void merge(const Block& other) {
    const double total = count + other.count;
    for (int value = 0; value < 4; value++) {
      const double shift = other.mean[value] - mean[value];
      squares[value] += other.squares[value] + shift * shift * count * other.count / total;
      mean[value] += shift * other.count / total;
    }
    bottom = std::min(bottom, other.bottom);
    top = std::max(top, other.top);
    count = total;
  }
};

using Map = std::unordered_map<int64_t, std::vector<Block>>;

static void insert(Map& map, const Point& point) {
  const int64_t column = std::floor(point.x / RESOLUTION), row = std::floor(point.y / RESOLUTION);
  std::vector<Block>& blocks = map[column * (int64_t(1) << 32) + row];
  Block block = {{point.x, point.y, point.z, point.strength}, {0.0, 0.0, 0.0, 0.0}, point.z, point.z, 1.0};
  for (size_t place = 0; place < blocks.size();) {
    if (point.z - blocks[place].top >= RESOLUTION || blocks[place].bottom - point.z >= RESOLUTION) {
      place++;
      continue;
    }
    block.merge(blocks[place]);
    blocks.erase(blocks.begin() + place);
  }
  blocks.push_back(block);
}

static std::vector<std::vector<Beam>> read(const char* path) {
  std::ifstream file(path, std::ios::binary);
  std::vector<std::vector<Beam>> scans(1);
  Beam beam;
  while (file.read(reinterpret_cast<char*>(&beam.pose), 18 * sizeof(double))) {
    int32_t bins;
    file.read(reinterpret_cast<char*>(&bins), 4);
    if (bins == 0) { scans.emplace_back(); continue; }
    beam.strengths.resize(bins);
    file.read(reinterpret_cast<char*>(beam.strengths.data()), bins);
    scans.back().push_back(beam);
  }
  scans.pop_back();
  return scans;
}

int main(int, char** arguments) {
  Map map;
  double seconds[4] = {0.0};
  size_t points = 0, blocks = 0;
  for (const std::vector<Beam>& beams : read(arguments[1])) {
    double times[5] = {cpu_seconds()};
    const Cloud cloud = projected(beams);
    times[1] = cpu_seconds();
    const Cloud strong = thresholded(cloud);
    times[2] = cpu_seconds();
    const Cloud kept = cleaned(strong);
    times[3] = cpu_seconds();
    for (const Point& point : kept) insert(map, point);
    times[4] = cpu_seconds();
    for (int stage = 0; stage < 4; stage++) seconds[stage] += times[stage + 1] - times[stage];
    points += kept.size();
  }
  for (const auto& cell : map) blocks += cell.second.size();
  for (double stage : seconds) std::printf("%.9f ", stage);
  std::printf("%zu %zu\n", points, blocks);
}
