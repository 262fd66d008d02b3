within WheelsetRig.Effects;
model CreepStiffness "A contact softer or stiffer than Kalker's theory"
  extends Quantities.PartialCreepStiffness;
  extends Common.Signals.Gain(gain(min=-0.9, max=1.0));
  annotation (
    __Workbench(effect(
      size="gain", matters=0.02,
      separation="a step of the vertical load by 10 %")),
    Documentation(info="<html>
<p><code>y = u*(1 + gain)</code>: a layer between wheel and roller. Equal to a gain of
both <code>kA</code> and <code>kS</code> of Polach's law; from its dry to its wet parameters the
stiffness falls by 71 %.</p>
<h4>References</h4>
<p>O. Polach (2005), Wear 258, 992-1000.</p>
</html>"));
end CreepStiffness;
