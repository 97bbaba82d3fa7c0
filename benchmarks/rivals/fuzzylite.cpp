// Times fuzzylite on a batch: fuzzylite SYSTEM.fll INPUTS NUM_SAMPLES OUTPUTS, doubles as they lie in memory.
// Prints the least processor time of some repeats, in seconds.

#include <ctime>
#include <fstream>
#include <iostream>
#include <memory>
#include <vector>

#include <fl/Headers.h>

int main(int, char* words[]) {
    std::unique_ptr<fl::Engine> engine(fl::FllImporter().fromFile(words[1]));
    const std::size_t num_inputs = engine->numberOfInputVariables();
    const std::size_t num_samples = std::stoul(words[3]);
    std::vector<double> inputs(num_samples * num_inputs), outputs(num_samples);
    std::ifstream(words[2], std::ios::binary)
        .read(reinterpret_cast<char*>(inputs.data()), std::streamsize(inputs.size() * sizeof(double)));
    std::vector<fl::InputVariable*> variables = engine->inputVariables();
    fl::OutputVariable* output = engine->getOutputVariable(0);
    double best = 1e300;
    for (int repeat = 0; repeat < 5; ++repeat) {
        const std::clock_t start = std::clock();
        for (std::size_t sample = 0; sample < num_samples; ++sample) {
            for (std::size_t place = 0; place < num_inputs; ++place)
                variables[place]->setValue(inputs[sample * num_inputs + place]);
            engine->process();
            outputs[sample] = output->getValue();
        }
        best = std::min(best, double(std::clock() - start) / CLOCKS_PER_SEC);
    }
    std::ofstream(words[4], std::ios::binary)
        .write(reinterpret_cast<const char*>(outputs.data()), std::streamsize(outputs.size() * sizeof(double)));
    std::cout << best << std::endl;
}
