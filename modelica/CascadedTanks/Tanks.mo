within CascadedTanks;
model Tanks "Torricelli's law in both tanks; levels in volts of the sensor"
  parameter Real k1(unit="V/s", min=1e-3, max=1.0) = 0.05 "Flow from the upper tank at a level of 1 V";
  parameter Real k3(unit="V/s", min=1e-3, max=1.0) = 0.05 "Flow from the lower tank at a level of 1 V";
  parameter Real k4(unit="1/s", min=1e-3, max=1.0) = 0.05 "Flow of the pump per voltage";
  input Real pump(unit="V") "Voltage of the pump";
  input Real dk3(unit="V/s") "Correction of k3";
  output Real level1(unit="V", start=5.0, fixed=true, nominal=5.0) "Level of the upper tank";
  output Real level2(unit="V", start=5.0, fixed=true, nominal=5.0) "Level of the lower tank";
  output Real level2Reading(unit="V") = sensor.y "Reading of the level of the lower tank";
  output Real outflow(unit="V/s") = lowerOutlet.actual "What leaves through the lower outlet";

  replaceable Common.Signals.Unchanged drive(u=pump) constrainedby Common.Interfaces.Signal(u=pump)
    "From the voltage to the flow of the pump";
  replaceable Slots.Outlet upperOutlet(nominal=k1*Functions.root(level1), h=level1, k=k1)
    constrainedby Slots.PartialOutlet(nominal=k1*Functions.root(level1), h=level1, k=k1)
    "Outlet of the upper tank";
  replaceable Slots.Outlet lowerOutlet(
    nominal=(k3 + dk3)*Functions.root(level2), h=level2, k=k3 + dk3)
    constrainedby Slots.PartialOutlet(
    nominal=(k3 + dk3)*Functions.root(level2), h=level2, k=k3 + dk3) "Outlet of the lower tank";
  replaceable Slots.Rim upperRim(h=level1, surplus=k4*drive.y - upperOutlet.actual)
    constrainedby Slots.PartialRim(h=level1, surplus=k4*drive.y - upperOutlet.actual)
    "Rim of the upper tank";
  replaceable Slots.Rim lowerRim(
    h=level2, surplus=upperOutlet.actual + upperRim.caught - lowerOutlet.actual)
    constrainedby Slots.PartialRim(
    h=level2, surplus=upperOutlet.actual + upperRim.caught - lowerOutlet.actual)
    "Rim of the lower tank";
  replaceable Slots.Tank lowerTank(
    nominal=upperOutlet.actual + upperRim.caught - lowerOutlet.actual - lowerRim.leaves, h=level2)
    constrainedby Slots.PartialTank(
    nominal=upperOutlet.actual + upperRim.caught - lowerOutlet.actual - lowerRim.leaves, h=level2)
    "Walls of the lower tank";
  replaceable Common.Signals.Unchanged sensor(u=level2)
    constrainedby Common.Interfaces.Signal(u=level2)
    "Sensor of the lower level";
equation
  der(level1) = k4*drive.y - upperOutlet.actual - upperRim.leaves;
  der(level2) = lowerTank.actual;
  annotation (
    experiment(StopTime=4000.0, Tolerance=1e-6),
    Documentation(info="<html>
<p><code>level1' = k4*u - k1*sqrt(level1)</code>, <code>level2' = k1*sqrt(level1) -
k3*sqrt(level2)</code>. What leaves the upper tank arrives in the lower one, which fixes the scale of
<code>level1</code>: then <code>k1</code>, <code>k3</code> and <code>k4</code> follow from the voltages of
pump and sensor alone.</p>
<h4>References</h4>
<p>M. Schoukens, P. Mattsson, T. Wigren, J.-P. Noel (2016), equations (1) to (3).</p>
</html>"));
end Tanks;
