//! probe
use servotune::diagnose::{bench::Bench, run::runs, refit::*};
use servotune::{recording::*, physics::*, lti::*};
use std::path::Path;
fn main(){
  let a=std::env::args().nth(1).unwrap(); let eff=std::env::args().nth(2).unwrap();
  let inner:Vec<f64>=std::env::args().nth(3).unwrap().split(',').filter_map(|v|v.parse().ok()).collect();
  let st:Vec<f64>=std::env::args().nth(4).unwrap().split(',').filter_map(|v|v.parse().ok()).collect();
    let case=Case::read(Path::new(&a),&RecordSettings::default()).unwrap();
    let pf:PlantFile=servotune::document::read_toml(&case.plant).unwrap();
    let plant=Plant::try_from(pf).unwrap();
    let dt=case.records[0].1.sample_time_s;
    let b=Bench::new(&plant,runs(&case),dt,case.spindle_hz).unwrap();
    let n=b.stack.total as f64;
    let e=effect(&eff).unwrap();
    let cont=vec![true;inner.len()].iter().enumerate().map(|(i,_)|i==0).collect();
    let ch=vec![Chosen{effect:e,setting:Setting{inner,strengths:st},continuous:cont}];
    let p=vec![0.0;b.form.knobs.len()];
    let mut f=b.fit(ch);
    println!("at given p: cost/N {:.4}",f.cost(&p)/n);
    for it in [4,8,8,8] { let t=std::time::Instant::now(); let r=f.refit(&p,it); println!("refit {it}: {:.5} {:?} p {:.4?} conv {} {:.2}s",r.cost/n,f.chosen[0].setting,&r.p[..4],r.converged,t.elapsed().as_secs_f64()); 
      let r2=f.refit(&r.p,it); println!("   again: {:.5} {:?} p {:.4?} {}",r2.cost/n,f.chosen[0].setting,&r2.p[..4],r2.converged); }
}
