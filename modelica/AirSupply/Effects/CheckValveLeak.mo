within AirSupply.Effects;
model CheckValveLeak "a check valve that lets air back while the compressor is off"
  extends Slots.PartialDelivery;
  parameter Real conductance(unit="kg/(s.Pa)", min=0.0, max=1e-8) = 0.0 "Flow per difference of pressure";
  final parameter Real p0(unit="Pa") = 101325.0 "Pressure of the surroundings";
equation
  actual = nominal - conductance*(1.0 - runs)*(p - p0);
  annotation (
    __Workbench(effect(
      size="conductance", matters=5e-11,
      slots={"compressor"},
      separation="a closed valve between compressor and reservoir")),
    Documentation(info="<html>
<p><code>actual = nominal - conductance*(1 - runs)*(p - p0)</code>: laminar, and only while the compressor is
off.</p>
</html>"));
end CheckValveLeak;
