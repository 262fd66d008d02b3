within CascadedTanks.Effects;
model UpperOverflow "an upper tank that overflows, in part into the lower one"
  extends Slots.PartialRim;
  parameter Real spilled(unit="1", min=0.0, max=1.0) = 0.0 "Of the surplus at the rim, that runs over";
  parameter Real rim(unit="V", min=2.0, max=20.0) = 10.0 "Level at the rim";
  parameter Real share(unit="1", min=0.0, max=1.0) = 0.5 "Of the overflow, that falls into the lower tank";
equation
  leaves = spilled*Common.Functions.above(surplus, 1e-3)*0.5*(1.0 + tanh((h - rim)/0.1));
  caught = share*leaves;
  annotation (
    __Workbench(effect(
      size="spilled", matters=0.2,
      shapes(rim={6.0, 8.0, 10.0, 12.0}, share={0.3, 0.8}),
      slots={"upperRim"},
      separation="a look at the upper rim while the pump runs at full voltage")),
    Documentation(info="<html>
<p>While more flows in than the outlet lets out, and the level is at the rim, a share
<code>spilled</code> of the surplus runs over: at 1 the level stays there. The rim is passed over a
tenth of a volt, as waves and a meniscus do. <code>share</code> of what runs over falls into the lower tank.</p>
<h4>References</h4>
<p>M. Schoukens, P. Mattsson, T. Wigren, J.-P. Noel (2016): overflow of the upper tank runs partly into
the lower tank, partly out of the system.</p>
</html>"));
end UpperOverflow;
