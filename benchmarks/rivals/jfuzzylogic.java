import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import net.sourceforge.jFuzzyLogic.FIS;
import net.sourceforge.jFuzzyLogic.FunctionBlock;

/** Evaluates an FCL file with jFuzzyLogic, each sample afresh: FILE BLOCK INPUTS OUTPUTS. */
class Answers {
    public static void main(String[] words) throws Exception {
        List<String> lines = Files.readAllLines(Path.of(words[2]));
        String[] inputs = lines.get(0).trim().split("\\s+");
        String[] outputs = lines.get(1).trim().split("\\s+");
        List<String> answers = new ArrayList<>();
        for (String line : lines.subList(2, lines.size())) {
            FIS file = FIS.load(words[0], false);
            FunctionBlock block = file.getFunctionBlock(words[1]);
            if (block == null) block = file.getFunctionBlock(null);  // one without a name
            String[] values = line.trim().split("\\s+");
            for (int index = 0; index < inputs.length; index++)
                block.setVariable(inputs[index], Double.parseDouble(values[index]));
            block.evaluate();
            StringBuilder answer = new StringBuilder();
            for (String name : outputs) answer.append(block.getVariable(name).getValue()).append(' ');
            answers.add(answer.toString());
        }
        Files.write(Path.of(words[3]), answers);
    }
}
