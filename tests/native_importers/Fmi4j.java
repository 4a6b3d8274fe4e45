import java.io.File;
import java.nio.file.Files;
import java.nio.file.Path;
import no.ntnu.ihb.fmi4j.importer.fmi2.Fmu;

/** Runs the default experiment with FMI4j and prints the final value of a Real variable: FMU VALUE_REFERENCE. */
public class Fmi4j {
    public static void main(String[] arguments) throws Exception {
        try (var fmu = Fmu.from(new File(arguments[0]))) {
            var slave = fmu.asCoSimulationFmu().newInstance();
            if (!slave.simpleSetup()) throw new IllegalStateException("not initialized");
            for (int i = 0; i < 1000; i++)
                if (!slave.doStep(i * 0.01, 0.01)) throw new IllegalStateException("step " + i);
            var value = new double[1];
            slave.readReal(new long[] {Long.parseLong(arguments[1])}, value);
            slave.terminate();
            if (Files.readString(Path.of("/proc/self/maps")).contains("libpython"))
                throw new IllegalStateException("Python is loaded");
            System.out.println("phi " + value[0]);
        }
    }
}
