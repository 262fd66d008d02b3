within TrainRig.Effects;
model WaterFilm "water on the discs of all axles, until their friction has dried it"
  extends Slots.PartialPads;
  parameter Real film(unit="1", min=0.0, max=1.2) = 0.0 "Film at the start, 1 on a wet disc";
  parameter Real E0(unit="J", min=500.0, max=2e6) = 0.45e6 "Friction energy of a disc that leaves 1/e of it";
  final parameter Real muWet(unit="1") = 0.12 "Friction on a wet disc";
  final parameter Real discs(unit="1") = 3.0 "Of an axle";
  Real E[n](each unit="J", each start=0.0, each fixed=true, each nominal=1e6)
    "Friction energy of one disc";
equation
  for i in 1:n loop
    y[i] = u[i] + (muWet - u[i])*film*exp(-E[i]/E0);
    der(E[i]) = power[i]/discs;
  end for;
  annotation (
    __Workbench(effect(
      size="film", matters=0.03,
      shapes(E0={2e3, 8e3, 30e3, 0.1e6, 0.3e6, 0.45e6, 1e6}),
      separation="another stop soon after, with dry discs")),
    Documentation(info="<html>
<p>Friction is between dry and wet by the share of the film that is left. The film leaves with
friction energy and not with time, as on the rig (<code>WheelsetRig.Effects.WaterFilm</code>).</p>
<h4>Limits</h4>
<p>No water arrives after the start, and all discs are alike.</p>
<h4>References</h4>
<p>UIC 541-3 limits the difference of wet to dry friction to 15 % of the mean.</p>
</html>"));
end WaterFilm;
