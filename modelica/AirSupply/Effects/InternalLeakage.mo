within AirSupply.Effects;
model InternalLeakage "a compressor that leaks back inside, in proportion to the pressure"
  extends Slots.PartialDelivery;
  parameter Real conductance(unit="kg/(s.Pa)", min=0.0, max=1e-7) = 0.0 "Flow per difference of pressure";
  final parameter Real p0(unit="Pa") = 101325.0 "Pressure of the surroundings";
equation
  actual = nominal - runs*conductance*(p - p0);
  annotation (
    __Workbench(effect(
      size="conductance", step=2e-10, matters=5e-10,
      slots={"compressor"},
      separation="its flow into the open, and against several pressures")),
    Documentation(info="<html>
<p><code>actual = nominal - runs*conductance*(p - p0)</code>: gaps at rings, valves or rotors.</p>
</html>"));
end InternalLeakage;
