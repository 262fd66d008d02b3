within HeatedHouse.Effects;
model Infiltration "air that leaks in more, the colder it is outside"
  extends Interfaces.PartialShell;
  parameter Real k(unit="W/K2", min=0.0, max=50.0) = 0.0 "Conductance per difference of temperatures";
equation
  actual = nominal + k*nominal/G*noEvent(abs(nominal/G));
  annotation (
    __Workbench(effect(
      size="k", matters=0.1,
      separation="decay of a tracer gas on a warm and on a cold day")),
    Documentation(info="<html>
<p><code>k*dT*|dT|</code>: the stack effect drives a flow of air that grows with the difference, and the
heat of that flow grows with it again.</p>
</html>"));
end Infiltration;
