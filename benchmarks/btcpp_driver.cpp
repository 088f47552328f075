// Ticks trees with BehaviorTree.CPP for the benchmarks, by its public API; built by hand, as README.md states.
//
// It reads commands from standard input, one JSON array in a line, and answers each with one JSON value: the CPU seconds that one load or
// one tick took, or a string that says why it cannot.
//
//     ["load", "FILE"]    make the tree of a file, in place of the one before
//     ["tick", COUNT]     tick it so many times; the mean
#include <behaviortree_cpp/bt_factory.h>

#include <cstdio>
#include <ctime>
#include <iostream>
#include <memory>
#include <regex>
#include <string>

namespace
{
double cpuSeconds()
{
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

std::string quoted(const std::string& text)
{
  std::string line = "\"";
  for(const char letter : text)
  {
    line += letter == '"' || letter == '\\' ? std::string{ '\\', letter } : std::string(1, letter < ' ' ? ' ' : letter);
  }
  return line + '"';
}
}  // namespace

int main()
{
  const std::regex load(R"-(\["load", "(.*)"\])-");
  const std::regex tick(R"-(\["tick", (\d+)\])-");
  BT::BehaviorTreeFactory factory;
  factory.registerSimpleAction("Leaf", [](BT::TreeNode&) { return BT::NodeStatus::SUCCESS; });
  std::unique_ptr<BT::Tree> tree;
  for(std::string line; std::getline(std::cin, line);)
  {
    std::smatch found;
    std::string answer;
    try
    {
      const double start = cpuSeconds();
      long count = 1;
      if(std::regex_match(line, found, load))
      {
        tree.reset();
        factory.clearRegisteredBehaviorTrees();
        tree = std::make_unique<BT::Tree>(factory.createTreeFromFile(found[1].str()));
      }
      else if(std::regex_match(line, found, tick) && tree)
      {
        count = std::stol(found[1].str());
        for(long number = 0; number < count; ++number)
        {
          tree->tickExactlyOnce();
        }
      }
      else
      {
        throw std::runtime_error("unknown command: " + line);
      }
      char text[32];
      std::snprintf(text, sizeof(text), "%.12g", (cpuSeconds() - start) / static_cast<double>(count));
      answer = text;
    }
    catch(const std::exception& error)
    {
      answer = quoted(error.what());
    }
    std::cout << answer << std::endl;
  }
  return 0;
}
