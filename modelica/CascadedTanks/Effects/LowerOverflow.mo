within CascadedTanks.Effects;
model LowerOverflow "a lower tank that overflows"
  extends Slots.PartialRim;
  parameter Real spilled(unit="1", min=0.0, max=1.0) = 0.0 "Of the surplus at the rim, that runs over";
  parameter Real rim(unit="V", min=2.0, max=20.0) = 10.0 "Level at the rim";
equation
  leaves = spilled*Common.Functions.above(surplus, 1e-3)*0.5*(1.0 + tanh((h - rim)/0.1));
  caught = 0.0;
  annotation (
    __Workbench(effect(
      size="spilled", matters=0.2,
      shapes(rim={8.0, 9.0, 9.8}),
      slots={"lowerRim"},
      separation="a look at the lower rim while the level is high")),
    Documentation(info="<html>
<p>While more flows in than the outlet lets out, and the level is at the rim, a share
<code>spilled</code> of the surplus runs over: at 1 the level stays there. The rim is passed over a
tenth of a volt, as waves and a meniscus do. Nothing of it is caught.</p>
<h4>References</h4>
<p>M. Schoukens, P. Mattsson, T. Wigren, J.-P. Noel (2016).</p>
</html>"));
end LowerOverflow;
