import java.nio.file.Files;
import java.nio.file.Path;
import org.javafmi.wrapper.Simulation;

/** Runs the default experiment with JavaFMI and prints the final angle: FMU VALUE_REFERENCE (not needed). */
public class JavaFmi {
    public static void main(String[] arguments) throws Exception {
        var simulation = new Simulation(arguments[0]);
        simulation.init(0.0, 10.0);
        for (int i = 0; i < 1000; i++) simulation.doStep(0.01);
        double phi = simulation.read("phi").asDouble();
        simulation.terminate();
        if (Files.readString(Path.of("/proc/self/maps")).contains("libpython"))
            throw new IllegalStateException("Python is loaded");
        System.out.println("phi " + phi);
    }
}
