within AirSupply.Effects;
model FallingEfficiency "a compressor that delivers less against a higher pressure"
  extends Slots.PartialDelivery;
  parameter Real fall(unit="1", min=0.0, max=4.0) = 0.0 "Relative loss, per relative rise of the pressure";
  final parameter Real pUsual(unit="Pa") = 1.01e6 "Pressure to which the nominal delivery refers";
equation
  actual = nominal*(1.0 - fall*(p - pUsual)/pUsual);
  annotation (
    __Workbench(effect(
      size="fall", matters=0.2,
      slots={"compressor"},
      separation="its flow against several pressures, held for minutes each")),
    Documentation(info="<html>
<p><code>actual = nominal*(1 - fall*(p - pUsual)/pUsual)</code>. What is left in the clearance expands
before fresh air is taken in: the volumetric efficiency is <code>1 - c*((p/p0)^(1/n) - 1)</code>, and gaps
at rings, valves or rotors let back what the pressure drives. Between the pressures at which the unit starts
and stops both are straight lines.</p>
<h4>References</h4>
<p>M. J. Moran, H. N. Shapiro, <em>Fundamentals of Engineering Thermodynamics</em>: reciprocating
compressors.</p>
</html>"));
end FallingEfficiency;
