within AirSupply.Effects;
model ClearanceVolume "a compressor that delivers less against a higher pressure, by its clearance"
  extends Slots.PartialDelivery;
  parameter Real clearance(unit="1", min=0.0, max=0.18) = 0.0 "Clearance, as a share of the displacement";
  final parameter Real p0(unit="Pa") = 101325.0 "Pressure of the surroundings";
equation
  actual = nominal*(1.0 - clearance*((p/p0)^(1.0/1.3) - 1.0));
  annotation (
    __Workbench(effect(
      size="clearance", step=2e-3, matters=5e-3,
      slots={"compressor"},
      separation="its flow into the open, and against several pressures")),
    Documentation(info="<html>
<p>Air that is left in the clearance expands before fresh air is taken in: the volumetric efficiency is
<code>1 - clearance*((p/p0)^(1/n) - 1)</code>, with n = 1.3.</p>
<h4>References</h4>
<p>M. J. Moran, H. N. Shapiro, <em>Fundamentals of Engineering Thermodynamics</em>, reciprocating
compressors.</p>
</html>"));
end ClearanceVolume;
